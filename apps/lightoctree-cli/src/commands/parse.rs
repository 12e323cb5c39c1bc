//! Parsers of option values such as `X,Y,Z` and `WxH`.

use lo_geometry::{MAX_COORDINATE_M, Vec3, is_position};
use lo_scene::{KnownLength, LightColor, MAX_KELVIN, MIN_KELVIN};

/// Parses `X,Y,Z` in metres, each within ± 10 km.
pub fn point(text: &str) -> Result<Vec3, String> {
    let point = Vec3::from_array(numbers(text, "X,Y,Z")?.map(|coordinate| coordinate as f32));
    if is_position(point) {
        Ok(point)
    } else {
        Err(format!("coordinates must be from -{MAX_COORDINATE_M} to {MAX_COORDINATE_M} m"))
    }
}

/// Parses `X,Y,Z` of any length above zero, and normalizes it.
pub fn direction(text: &str) -> Result<Vec3, String> {
    let direction: [f64; 3] = numbers(text, "X,Y,Z")?;
    // Divides by the largest component first, because squares of f64 values may overflow or vanish in f32.
    let largest = direction.iter().fold(0.0f64, |largest, component| largest.max(component.abs()));
    let scaled = Vec3::from_array(direction.map(|component| (component / largest) as f32));
    scaled.try_normalize().ok_or_else(|| "a direction must not be zero".into())
}

/// Parses `FX,FY,CX,CY` in pixels.
pub fn intrinsics(text: &str) -> Result<[f64; 4], String> {
    numbers(text, "FX,FY,CX,CY")
}

/// Parses `U,V` in pixels of the photo.
pub fn pixel(text: &str) -> Result<[f64; 2], String> {
    numbers(text, "U,V")
}

/// Parses `U,V,U,V` in pixels of the photo: two positions.
pub fn pixels(text: &str) -> Result<[[f64; 2]; 2], String> {
    numbers(text, "U,V,U,V").map(|[u, v, s, t]| [[u, v], [s, t]])
}

/// Parses `U,V,U,V,METRES`: two positions in pixels of the photo, and the real length between them.
pub fn known_length(text: &str) -> Result<KnownLength, String> {
    let [u, v, s, t, length_m] = numbers(text, "U,V,U,V,METRES")?;
    Ok(KnownLength { ends: [[u, v], [s, t]], length_m })
}

/// Parses `X,Y,R` in pixels: centre and radius of a circle.
pub fn circle(text: &str) -> Result<[f64; 3], String> {
    numbers(text, "X,Y,R")
}

/// Parses a value above 0 and at most 1, or one for each of `R,G,B`.
pub fn reflectance(text: &str) -> Result<[f32; 3], String> {
    let all = if text.contains(',') { numbers(text, "R,G,B")? } else { [numbers::<1>(text, "a number")?[0]; 3] };
    if all.iter().all(|&v| v as f32 > 0.0 && v <= 1.0) {
        Ok(all.map(|v| v as f32))
    } else {
        Err("must be above 0 and at most 1".into())
    }
}

/// Parses a temperature such as `3000K`, or linear `R,G,B`.
pub fn light_color(text: &str) -> Result<LightColor, String> {
    if let Some(kelvin) = text.strip_suffix(['K', 'k']) {
        let [kelvin]: [f64; 1] = numbers(kelvin, "a temperature")?;
        let kelvin = kelvin as f32;
        let range = MIN_KELVIN..=MAX_KELVIN;
        return if range.contains(&kelvin) {
            Ok(LightColor::Kelvin(kelvin))
        } else {
            Err(format!("the temperature must be from {MIN_KELVIN} K to {MAX_KELVIN} K"))
        };
    }
    if !text.contains(',') {
        return Err(format!("`{text}` is neither a temperature such as 3000K nor R,G,B"));
    }
    let rgb = numbers(text, "R,G,B")?.map(|channel| channel as f32);
    if rgb.iter().all(|c| (0.0..=1e6).contains(c)) && rgb.iter().any(|c| *c > 1e-3) {
        Ok(LightColor::Rgb(rgb))
    } else {
        Err("R, G and B must be from 0 to 1000000, and at least one of them above 0.001".into())
    }
}

/// Parses `W,H` in metres, each above 0.
pub fn extent(text: &str) -> Result<[f32; 2], String> {
    let sides: [f64; 2] = numbers(text, "W,H")?;
    if sides.iter().all(|side| *side > 0.0) {
        Ok(sides.map(|side| side as f32))
    } else {
        Err("W and H must be above 0".into())
    }
}

/// Parses `NX,NY,NZ`, each from 1 to 10000.
pub fn counts(text: &str) -> Result<[usize; 3], String> {
    let numbers: [f64; 3] = numbers(text, "NX,NY,NZ")?;
    if numbers.iter().any(|&n| n < 1.0 || n.fract() != 0.0 || n > 10_000.0) {
        return Err("NX, NY and NZ must be integers from 1 to 10000".into());
    }
    Ok(numbers.map(|n| n as usize))
}

/// Parses `WxH` in pixels.
pub fn size(text: &str) -> Result<[usize; 2], String> {
    let wrong = || format!("`{text}` is not of the form WxH, such as 256x128");
    let (width, height) = text.split_once(['x', 'X', '×']).ok_or_else(wrong)?;
    let parse = |part: &str| part.trim().parse::<usize>().map_err(|_| wrong());
    let size = [parse(width)?, parse(height)?];
    if size.iter().any(|&s| !(1..=16_384).contains(&s)) {
        return Err("width and height must be from 1 to 16384 pixels".into());
    }
    Ok(size)
}

/// Parses `I/N`: part I of N, counted from 1.
pub fn part(text: &str) -> Result<[u32; 2], String> {
    let numbers = text.split_once('/').and_then(|(i, n)| Some([i.trim().parse().ok()?, n.trim().parse().ok()?]));
    match numbers {
        Some([i, n]) if (1..=n).contains(&i) => Ok([i, n]),
        _ => Err(format!("`{text}` is not of the form I/N with I from 1 to N, such as 3/16")),
    }
}

/// Parses `A,B`: a range of fields of view within 5 to 150 degrees.
pub fn hfov_range_deg(text: &str) -> Result<[f32; 2], String> {
    let [least, most]: [f64; 2] = numbers(text, "A,B")?;
    if !(5.0..=150.0).contains(&least) || !(least..=150.0).contains(&most) {
        return Err("fields of view must be from 5 to 150 degrees, the smaller one first".into());
    }
    Ok([least as f32, most as f32])
}

/// A list of exposures in stops.
#[derive(Clone, Debug, PartialEq)]
pub struct ExposuresEv(pub Vec<f64>);

/// Parses `EV,EV,…`, each from −20 to 20 stops.
pub fn exposures_ev(text: &str) -> Result<ExposuresEv, String> {
    let exposure = |part: &str| match part.trim().parse::<f64>() {
        Ok(ev) if ev.abs() <= 20.0 => Ok(ev),
        Ok(ev) => Err(format!("{ev} EV is out of range; exposures must be from -20 to 20 EV")),
        Err(_) => Err(format!("`{}` in EV,EV,… is not a number", part.trim())),
    };
    text.split(',').map(exposure).collect::<Result<_, _>>().map(ExposuresEv)
}

/// Parses a share from 0 to 1.
pub fn share(text: &str) -> Result<f64, String> {
    up_to(text, 1.0)
}

/// Parses a factor of contrast from 0 to 3.
pub fn contrast(text: &str) -> Result<f64, String> {
    up_to(text, 3.0)
}

/// Parses a warmth from −4 to 4 stops.
pub fn warmth(text: &str) -> Result<f64, String> {
    within(text, 4.0, "stops")
}

/// Parses a strength of shadows from 0 to 4.
pub fn shadow_strength(text: &str) -> Result<f64, String> {
    up_to(text, 4.0)
}

/// Parses a number above 0 and at most 10¹².
pub fn positive(text: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
    if value > 0.0 && value <= 1e12 { Ok(value) } else { Err("must be above 0 and at most 1e12".into()) }
}

/// Parses an angle within ± 3600 degrees.
pub fn angle_deg(text: &str) -> Result<f64, String> {
    within(text, 3600.0, "degrees")
}

/// Parses an angle above the horizon, −90 to 90 degrees.
pub fn elevation_deg(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(angle) if (-90.0..=90.0).contains(&angle) => Ok(angle),
        _ => Err("must be a number of degrees from -90 to 90".to_owned()),
    }
}

/// Parses an exposure within ± 40 stops.
pub fn exposure_ev(text: &str) -> Result<f64, String> {
    within(text, 40.0, "stops")
}

/// Parses `FIRST-LAST`, two numbers of frames in order.
pub fn number_range(text: &str) -> Result<[u32; 2], String> {
    let wrong = || format!("`{text}` is not FIRST-LAST, such as 1001-1048");
    let (first, last) = text.split_once('-').ok_or_else(wrong)?;
    let [first, last] = [first, last].map(|number| number.trim().parse::<u32>().map_err(|_| wrong()));
    let range = [first?, last?];
    if range[0] <= range[1] { Ok(range) } else { Err(format!("{} is after {}", range[0], range[1])) }
}

fn up_to(text: &str, limit: f64) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if (0.0..=limit).contains(&value) => Ok(value),
        _ => Err(format!("must be a number from 0 to {limit}")),
    }
}

fn within(text: &str, limit: f64, unit: &str) -> Result<f64, String> {
    let value: f64 = text.parse().map_err(|_| format!("`{text}` is not a number"))?;
    if (-limit..=limit).contains(&value) { Ok(value) } else { Err(format!("must be from -{limit} to {limit} {unit}")) }
}

fn numbers<const N: usize>(text: &str, form: &str) -> Result<[f64; N], String> {
    let parts: Vec<f64> = text
        .split(',')
        .map(|part| part.trim().parse::<f64>().map_err(|_| format!("`{}` in {form} is not a number", part.trim())))
        .collect::<Result<_, _>>()?;
    if let Some(bad) = parts.iter().find(|value| !value.is_finite()) {
        return Err(format!("{bad} in {form} is not a finite number"));
    }
    <[f64; N]>::try_from(parts).map_err(|parts| format!("{form} needs {N} numbers, got {}", parts.len()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn good_and_bad_values() {
        assert_eq!(point("1, -2,0.5"), Ok(Vec3::new(1.0, -2.0, 0.5)));
        assert_eq!(point("1,2"), Err("X,Y,Z needs 3 numbers, got 2".into()));
        assert_eq!(point("1,b,2"), Err("`b` in X,Y,Z is not a number".into()));
        assert_eq!(point("1,nan,2"), Err("NaN in X,Y,Z is not a finite number".into()));
        for far in ["1e39,0,0", "0,1e30,0", "0,0,-10001"] {
            assert_eq!(point(far), Err("coordinates must be from -10000 to 10000 m".into()));
        }
        for length in ["1e-300", "1e-30", "2", "1e30", "1e300"] {
            assert_eq!(direction(&format!("0,-{length},0")), Ok(Vec3::NEG_Y));
        }
        assert_eq!(direction("0,-0,0"), Err("a direction must not be zero".into()));
        assert_eq!(size("256x128"), Ok([256, 128]));
        assert!(size("256").is_err() && size("0x4").is_err() && size("99999x4").is_err());
        assert_eq!(counts("3,2,1"), Ok([3, 2, 1]));
        assert!(counts("0,1,1").is_err() && counts("1.5,1,1").is_err());
        assert_eq!(reflectance("0.5"), Ok([0.5; 3]));
        assert_eq!(reflectance("0.5, 1,0.25"), Ok([0.5, 1.0, 0.25]));
        assert!(["0", "1.1", "0.5,0.5", "-1", "nan", "1e-300"].iter().all(|text| reflectance(text).is_err()));
        let known = KnownLength { ends: [[1.0, 2.0], [3.0, 4.5]], length_m: 2.01 };
        assert_eq!(known_length("1,2,3,4.5,2.01"), Ok(known));
        assert!(known_length("1,2,3,4.5").is_err() && known_length("1,2,3,4.5,inf").is_err());
        assert_eq!(circle("3,4.5,100"), Ok([3.0, 4.5, 100.0]));
        assert_eq!(part("3/16"), Ok([3, 16]));
        assert!(["0/4", "5/4", "1", "a/2", "1/0"].iter().all(|text| part(text).is_err()));
        assert_eq!(hfov_range_deg("60,80"), Ok([60.0, 80.0]));
        assert!(["80,60", "1,80", "60", "60,170"].iter().all(|text| hfov_range_deg(text).is_err()));
        assert_eq!(exposures_ev("0,-0.5, 1"), Ok(ExposuresEv(vec![0.0, -0.5, 1.0])));
        assert!(["0,x", "nan", "0,21"].iter().all(|text| exposures_ev(text).is_err()));
        assert_eq!(light_color("3000K"), Ok(LightColor::Kelvin(3000.0)));
        assert_eq!(light_color("1, 0.5,0"), Ok(LightColor::Rgb([1.0, 0.5, 0.0])));
        assert!(["900K", "warm", "0,0,0", "1,2", "-1,1,1", "nanK"].iter().all(|text| light_color(text).is_err()));
        assert_eq!(extent("1.2,0.3"), Ok([1.2, 0.3]));
        assert!(extent("1,0").is_err() && extent("1").is_err());
        assert!(
            positive("0").is_err() && positive("inf").is_err() && positive("1e30").is_err() && positive("2").is_ok()
        );
    }
}
