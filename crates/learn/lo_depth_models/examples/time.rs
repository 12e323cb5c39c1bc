//! Time and memory of a depth model.
//!
//! `cargo run --release -p lo_depth_models --example time FILE WIDTHxHEIGHT [RUNS [THREADS]]`; for onnxruntime,
//! `tests/fixtures/time_onnxruntime.py` does the same.

use std::error::Error;
use std::time::Instant;

use lo_depth_models::DepthModel;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let [file, size, rest @ ..] = &args[..] else { return Err("FILE WIDTHxHEIGHT [RUNS [THREADS]]".into()) };
    let (width, height) = size.split_once('x').ok_or("WIDTHxHEIGHT")?;
    let (width, height): (usize, usize) = (width.parse()?, height.parse()?);
    let number = |index: usize, usual: usize| rest.get(index).map_or(Ok(usual), |text| text.parse());
    let (runs, threads) = (number(0, 5)?, number(1, 2)?);
    rayon::ThreadPoolBuilder::new().num_threads(threads).build_global()?;
    let begun = Instant::now();
    let model = DepthModel::read(file, None)?;
    println!("{}: read in {:.2} s", model.name(), begun.elapsed().as_secs_f64());
    let image: Vec<f32> = (0..3 * width * height).map(|index| (index % 255) as f32 / 255.0).collect();
    let mut times = Vec::new();
    for run in 0..=runs {
        let begun = Instant::now();
        let outputs = model.raw(&[1, 3, height, width], &image)?;
        let took = begun.elapsed().as_secs_f64();
        match run {
            0 => println!("first run, with planning: {took:.2} s, first value {}", outputs[0].2[0]),
            _ => times.push(took),
        }
    }
    times.sort_by(f64::total_cmp);
    println!(
        "{size}, {threads} threads: {:.3} s minimum, {:.3} s median of {runs} runs",
        times[0],
        times[times.len() / 2]
    );
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let peak = status.lines().find(|line| line.starts_with("VmHWM")).unwrap_or("no /proc");
    println!("{peak}");
    Ok(())
}
