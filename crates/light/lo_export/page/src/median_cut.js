/**
 * Cuts a panorama into 2^levels regions of equal energy, each a light: Debevec, "A Median Cut Algorithm for Light Probe
 * Sampling", SIGGRAPH 2005. The panorama is in three.js's orientation, from the lowest row, RGBA.
 *
 * @returns {{ direction: number[], radius: number, flux: number[] }[]} directions towards the lights, angular radii in
 *   radians, ∫ radiance dω
 */
export function medianCut(panorama, width, height, levels) {
  const energy = new Float64Array(width * height);
  const solidAngles = Array.from({ length: height }, (_, row) => {
    const [below, above] = [row, row + 1].map((edge) => Math.PI * (edge / height - 0.5));
    return ((2 * Math.PI) / width) * (Math.sin(above) - Math.sin(below));
  });
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      const at = 4 * (y * width + x);
      const luminance = 0.2126 * panorama[at] + 0.7152 * panorama[at + 1] + 0.0722 * panorama[at + 2];
      energy[y * width + x] = luminance * solidAngles[y];
    }
  }
  let regions = [{ x: [0, width], y: [0, height] }];
  for (let level = 0; level < levels; level++) regions = regions.flatMap((region) => halves(region, energy, width, height));
  return regions.map((region) => light(region, panorama, solidAngles, width, height)).filter(({ flux }) => Math.max(...flux) > 0);
}

/** Cuts a region across its longer side, which is shorter the nearer it is to a pole. */
function halves({ x, y }, energy, width, height) {
  const latitude = Math.PI * ((y[0] + y[1]) / 2 / height - 0.5);
  const across = (x[1] - x[0]) * Math.cos(latitude) >= y[1] - y[0] ? x : y;
  if (across[1] - across[0] < 2) return [{ x, y }];
  const sums = [];
  for (let line = across[0]; line < across[1]; line++) {
    let sum = 0;
    if (across === x) for (let row = y[0]; row < y[1]; row++) sum += energy[row * width + line];
    else for (let column = x[0]; column < x[1]; column++) sum += energy[line * width + column];
    sums.push(sum);
  }
  const half = sums.reduce((a, b) => a + b, 0) / 2;
  let [cut, sum] = [1, sums[0]];
  while (cut < sums.length - 1 && sum + sums[cut] / 2 < half) sum += sums[cut++];
  const middle = across[0] + cut;
  return across === x
    ? [{ x: [x[0], middle], y }, { x: [middle, x[1]], y }]
    : [{ x, y: [y[0], middle] }, { x, y: [middle, y[1]] }];
}

function light({ x, y }, panorama, solidAngles, width, height) {
  const flux = [0, 0, 0];
  const sum = [0, 0, 0];
  let solidAngle = 0;
  for (let row = y[0]; row < y[1]; row++) {
    for (let column = x[0]; column < x[1]; column++) {
      const radiance = [0, 1, 2].map((channel) => panorama[4 * (row * width + column) + channel]);
      const towards = direction(column, row, width, height);
      for (const channel of [0, 1, 2]) {
        flux[channel] += radiance[channel] * solidAngles[row];
        sum[channel] += towards[channel] * (radiance[0] + radiance[1] + radiance[2]) * solidAngles[row];
      }
      solidAngle += solidAngles[row];
    }
  }
  const length = Math.hypot(...sum) || 1;
  return { direction: sum.map((value) => value / length), radius: Math.acos(Math.max(-1, 1 - solidAngle / (2 * Math.PI))), flux };
}

/** The direction of a pixel: three.js reads u = atan2(z, x) / 2π + ½ and v = asin(y) / π + ½. */
export function direction(x, y, width, height) {
  const longitude = 2 * Math.PI * ((x + 0.5) / width - 0.5);
  const latitude = Math.PI * ((y + 0.5) / height - 0.5);
  return [Math.cos(latitude) * Math.cos(longitude), Math.sin(latitude), Math.cos(latitude) * Math.sin(longitude)];
}
