//! `lightoctree-lab bench`: our benchmarks of the peers' kit, in the kit's output format.
//!
//! Each case runs in its own process, as in the kit, so that memory is measured separately.

use std::process::Command;
use std::time::Instant;

use self::cases::{CASES, Case};
use anyhow::Context;
use lightoctree_cli::args::Global;
use lightoctree_cli::usage::Usage;
use lightoctree_cli::{interrupt, report};
use lo_eval::memory;
use serde::{Deserialize, Serialize};

mod cases;
mod input;

/// Options of `bench`.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  \
    PEERS_INPUT=peers/input lightoctree-lab bench --threads 1\n  \
    peers/run.sh --tuned --threads 1 --ours 'lightoctree-lab bench --threads 1 --json'\n\n\
    PEERS_INPUT is the folder written by the kit's make_input.py: rgbd_*.npy, room_*.npy, room_rgba128.npy and \
    input.json.\n\
    The cases `estimate_panorama` and `insert_draft` use the built-in photo and mesh, without PEERS_INPUT.")]
pub struct Args {
    /// Print one JSON object per line instead of a table
    #[arg(long)]
    json: bool,

    /// Run only cases whose name contains this; repeatable
    #[arg(long, value_name = "NAME")]
    only: Vec<String>,

    /// Timed repetitions per case
    #[arg(long, value_name = "N", default_value_t = 7, value_parser = clap::value_parser!(u32).range(1..=1000))]
    reps: u32,

    /// Print the names of the cases, and exit
    #[arg(long)]
    list: bool,

    /// Run one case in this process (used by `bench` itself)
    #[arg(long, hide = true)]
    child: Option<String>,
}

/// Result of one case; field names are the kit's.
#[derive(Debug, Serialize, Deserialize)]
struct BenchResult {
    peer: String,
    case: String,
    threads: usize,
    min_s: f64,
    median_s: f64,
    peak_rss_mib: Option<f64>,
    base_rss_mib: Option<f64>,
    reps: usize,
    nodes: Option<usize>,
}

/// Runs the selected cases one after another.
pub fn run(global: &Global, args: &Args) -> anyhow::Result<()> {
    if let Some(name) = &args.child {
        let case = CASES.iter().find(|case| case.name == name).with_context(|| format!("no case named {name}"))?;
        return report::print_json(&measure(case, args.reps as usize)?);
    }
    let chosen: Vec<&Case> = CASES
        .iter()
        .filter(|case| args.only.is_empty() || args.only.iter().any(|only| case.name.contains(only.as_str())))
        .collect();
    if chosen.is_empty() {
        return Err(
            Usage(format!("no case name contains `{}`; --list prints all names", args.only.join("`, `"))).into()
        );
    }
    if args.list {
        chosen.iter().for_each(|case| report::print(case.name));
        return Ok(());
    }
    let mut rows = Vec::new();
    for case in chosen {
        if interrupt::requested() {
            break;
        }
        let line = in_own_process(global, case, args.reps)?;
        if args.json {
            report::print_json(&line)?;
        } else {
            rows.push(row(&line));
        }
    }
    if !args.json {
        report::print(&report::table(&["case", "threads", "min", "median", "peak MiB", "base MiB", "nodes"], &rows));
    }
    Ok(())
}

/// Formats a row of the table.
fn row(line: &BenchResult) -> Vec<String> {
    let mib = |value: Option<f64>| value.map_or_else(|| "-".into(), |mib| format!("{mib:.0}"));
    vec![
        line.case.clone(),
        line.threads.to_string(),
        format!("{:.2} ms", 1e3 * line.min_s),
        format!("{:.2} ms", 1e3 * line.median_s),
        mib(line.peak_rss_mib),
        mib(line.base_rss_mib),
        line.nodes.map_or_else(|| "-".into(), |nodes| nodes.to_string()),
    ]
}

/// Runs a case in a child process.
fn in_own_process(global: &Global, case: &Case, reps: u32) -> anyhow::Result<BenchResult> {
    let program = std::env::current_exe().context("cannot find this program")?;
    let mut command = Command::new(program);
    command.args(["bench", "--child", case.name, "--reps", &reps.to_string()]);
    if let Some(threads) = global.threads {
        command.args(["--threads", &threads.to_string()]);
    }
    let done = command.output().with_context(|| format!("cannot start the case {}", case.name))?;
    if !done.status.success() {
        let message = String::from_utf8_lossy(&done.stderr);
        anyhow::bail!("{}: {}", case.name, message.trim().trim_start_matches("error: "));
    }
    serde_json::from_slice(&done.stdout).with_context(|| format!("the case {} gave no result", case.name))
}

/// Runs a case in this process.
fn measure(case: &Case, reps: usize) -> anyhow::Result<BenchResult> {
    let mut prepared = (case.prepare)()?;
    let base_rss_mib = memory::current_mib();
    memory::reset_peak();
    let nodes = (prepared.run)(); // warm-up
    let mut times: Vec<f64> = (0..reps)
        .map(|_| {
            let begun = Instant::now();
            (prepared.run)();
            begun.elapsed().as_secs_f64()
        })
        .collect();
    times.sort_by(f64::total_cmp);
    Ok(BenchResult {
        peer: "lightoctree".into(),
        case: case.name.into(),
        threads: rayon::current_num_threads(),
        min_s: times[0],
        median_s: times[times.len() / 2],
        peak_rss_mib: memory::peak_mib(),
        base_rss_mib,
        reps,
        nodes,
    })
}
