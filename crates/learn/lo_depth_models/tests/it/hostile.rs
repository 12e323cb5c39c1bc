//! Damaged and hostile files: they give an error, and neither a panic nor a large allocation.

use std::path::{Path, PathBuf};

use lo_depth_models::{DepthModel, ModelConfig, ModelError, Prediction};
use lo_geometry::Camera;
use lo_imaging::Image;

fn varint(mut value: u64) -> Vec<u8> {
    let mut bytes = Vec::new();
    while value >= 0x80 {
        bytes.push(value as u8 | 0x80);
        value >>= 7;
    }
    bytes.push(value as u8);
    bytes
}

/// A length-delimited field of Protocol Buffers.
fn field(number: u8, content: &[u8]) -> Vec<u8> {
    [varint(u64::from(number) << 3 | 2), varint(content.len() as u64), content.to_vec()].concat()
}

fn int(number: u8, value: u64) -> Vec<u8> {
    [varint(u64::from(number) << 3), varint(value)].concat()
}

fn text(number: u8, text: &str) -> Vec<u8> {
    field(number, text.as_bytes())
}

fn node(op: &str, inputs: &[&str], outputs: &[&str], attributes: &[Vec<u8>]) -> Vec<u8> {
    let mut bytes = Vec::new();
    inputs.iter().for_each(|name| bytes.extend(text(1, name)));
    outputs.iter().for_each(|name| bytes.extend(text(2, name)));
    bytes.extend(text(4, op));
    attributes.iter().for_each(|attribute| bytes.extend(field(5, attribute)));
    field(1, &bytes)
}

fn attribute_int(name: &str, value: u64) -> Vec<u8> {
    [text(1, name), int(3, value), int(20, 2)].concat()
}

/// A tensor of 64-bit integers.
fn ints(name: &str, dims: &[u64], values: &[i64]) -> Vec<u8> {
    let raw: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
    let dims = dims.iter().flat_map(|&dim| int(1, dim)).collect();
    field(5, &[dims, int(2, 7), text(8, name), field(9, &raw)].concat())
}

fn info(number: u8, name: &str, dims: &[u64]) -> Vec<u8> {
    let dims: Vec<u8> = dims.iter().flat_map(|&dim| field(1, &int(1, dim))).collect();
    let kind = field(1, &[int(1, 1), field(2, &dims)].concat());
    field(number, &[text(1, name), field(2, &kind)].concat())
}

/// A file with the input `x` [1, 3, 14, 28] and the output `y`.
fn file(graph: &[Vec<u8>], further: &[Vec<u8>]) -> Vec<u8> {
    let graph = [graph.concat(), info(11, "x", &[1, 3, 14, 28]), field(12, &text(1, "y"))].concat();
    [int(1, 8), field(7, &graph), field(8, &int(2, 17)), further.concat()].concat()
}

fn run(bytes: &[u8]) -> Result<Prediction, ModelError> {
    let config = ModelConfig::parse("kind = \"metric\"").unwrap();
    predicted(DepthModel::from_bytes(bytes, Some(&config))?)
}

fn predicted(model: DepthModel) -> Result<Prediction, ModelError> {
    let photo = Image::from_fn(56, 28, |x, y| [4 * x as u8, 8 * y as u8, 100]);
    let camera = Camera::from_hfov_deg(60.0, 56, 28).unwrap();
    model.predict(&photo, Some(&camera), &mut |_| std::ops::ControlFlow::Continue(()))
}

/// Peak memory of this process in bytes.
fn peak_bytes() -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
    line.and_then(|line| line.trim().trim_end_matches(" kB").parse::<u64>().ok()).unwrap_or(0) << 10
}

#[test]
fn the_builder_builds_what_runs() {
    let mean = node(
        "ReduceMean",
        &["x"],
        &["y"],
        &[[text(1, "axes"), int(8, 1), int(20, 7)].concat(), attribute_int("keepdims", 0)],
    );
    assert!(run(&file(&[mean], &[])).is_ok());
}

#[test]
fn integer_divisions_that_overflow_are_errors() {
    for (op, smallest) in [("Div", i64::MIN), ("Mod", i64::MIN), ("Div", i64::from(i32::MIN))] {
        let quotient = node(op, &["a", "b"], &["c"], &[]);
        let reshaped = node("Reshape", &["x", "c"], &["y"], &[]);
        let file = file(&[ints("a", &[2], &[8, smallest]), ints("b", &[2], &[2, -1]), quotient, reshaped], &[]);
        let error = run(&file).unwrap_err().to_string();
        // Not the message of a caught panic.
        assert!(error.contains("divides the smallest integer by -1"), "{error}");
    }
}

#[test]
fn sizes_do_not_explode() {
    let big = 1 << 40;
    let reduce = node("ReduceMax", &["big"], &["y"], &[]);
    let doubled = |count: usize| {
        let mut nodes = vec![node("Identity", &["x"], &["d0"], &[])];
        for index in 0..count {
            let (from, to) = (format!("d{index}"), format!("d{}", index + 1));
            nodes.push(node("Concat", &[&from, &from], &[&to], &[attribute_int("axis", 3)]));
        }
        nodes.push(node("ReduceMax", &[&format!("d{count}")], &["y"], &[]));
        file(&nodes, &[])
    };
    let outer = |count: usize| {
        let mut nodes = vec![ints("column", &[4], &[1, 1, 1176, 1]), ints("row", &[4], &[1, 1, 1, 1176])];
        nodes.push(node("Reshape", &["x", "column"], &["a"], &[]));
        nodes.push(node("Reshape", &["x", "row"], &["b"], &[]));
        nodes.push(node("MatMul", &["a", "b"], &["p0"], &[]));
        for index in 0..count {
            let (from, to) = (format!("p{index}"), format!("p{}", index + 1));
            nodes.push(node("MatMul", &[&from, &from], &[&to], &[]));
        }
        nodes.push(node("ReduceMax", &[&format!("p{count}")], &["y"], &[]));
        file(&nodes, &[])
    };
    let files = [
        (
            "ConstantOfShape",
            file(&[ints("s", &[2], &[big, big]), node("ConstantOfShape", &["s"], &["big"], &[]), reduce.clone()], &[]),
        ),
        (
            "ConstantOfShape of 64 GB",
            file(&[ints("s", &[1], &[1 << 34]), node("ConstantOfShape", &["s"], &["big"], &[]), reduce.clone()], &[]),
        ),
        (
            "Expand",
            file(
                &[ints("s", &[5], &[big, 1, 1, 1, 1]), node("Expand", &["x", "s"], &["big"], &[]), reduce.clone()],
                &[],
            ),
        ),
        (
            "Tile",
            file(
                &[ints("s", &[4], &[1 << 20, 1 << 20, 1, 1]), node("Tile", &["x", "s"], &["big"], &[]), reduce.clone()],
                &[],
            ),
        ),
        (
            "Range",
            file(
                &[
                    ints("a", &[], &[0]),
                    ints("b", &[], &[i64::MAX]),
                    ints("c", &[], &[1]),
                    node("Range", &["a", "b", "c"], &["big"], &[]),
                    reduce.clone(),
                ],
                &[],
            ),
        ),
        (
            "Range without end",
            file(
                &[
                    ints("a", &[], &[0]),
                    ints("b", &[], &[9]),
                    ints("c", &[], &[0]),
                    node("Range", &["a", "b", "c"], &["big"], &[]),
                    reduce.clone(),
                ],
                &[],
            ),
        ),
        (
            "Pad",
            file(
                &[
                    ints("s", &[8], &[0, 0, big, big, 0, 0, big, big]),
                    node("Pad", &["x", "s"], &["big"], &[]),
                    reduce.clone(),
                ],
                &[],
            ),
        ),
        (
            "Resize",
            file(
                &[
                    ints("s", &[4], &[1, 3, 1 << 20, 1 << 20]),
                    node("Resize", &["x", "", "", "s"], &["big"], &[]),
                    reduce.clone(),
                ],
                &[],
            ),
        ),
        (
            "OneHot",
            file(
                &[
                    ints("d", &[], &[big]),
                    ints("v", &[2], &[0, 1]),
                    ints("i", &[2], &[0, 1]),
                    node("OneHot", &["i", "d", "v"], &["big"], &[]),
                    reduce.clone(),
                ],
                &[],
            ),
        ),
        ("Concat doubles", doubled(60)),
        // Each tensor is small enough, but a run is too large.
        ("many of 100 MB", {
            let mut nodes = vec![ints("s", &[4], &[1, 3, 3000, 3000])];
            let mut sum = "x".to_owned();
            for index in 0..40 {
                nodes.push(node("Resize", &["x", "", "", "s"], &[&format!("r{index}")], &[]));
            }
            for index in 0..40 {
                let next = format!("s{index}");
                let from = if index == 0 { "r0".to_owned() } else { sum };
                nodes.push(node("Add", &[&from, &format!("r{index}")], &[&next], &[]));
                sum = next;
            }
            nodes.push(node("ReduceMax", &[&sum], &["y"], &[]));
            file(&nodes, &[])
        }),
        ("hours of products", outer(20_000)),
        ("Loop", file(&[node("Loop", &["", "", "x"], &["y"], &[])], &[])),
        ("NonZero", file(&[node("NonZero", &["x"], &["y"], &[])], &[])),
        ("a shape of values", file(&[node("ConstantOfShape", &["x"], &["y"], &[])], &[])),
    ];
    for (name, bytes) in files {
        let error = run(&bytes).unwrap_err();
        println!("{name}: {error}");
        assert!(matches!(error, ModelError::TooLarge(_) | ModelError::Node { .. }), "{name}: {error}");
        assert!(!error.to_string().contains("internal error in rten"), "{name}: {error}");
    }
    assert!(peak_bytes() < 1 << 30, "{}", peak_bytes());
}

#[test]
fn deep_nesting_and_cycles_are_errors() {
    // Nested branches, deeper than any stack.
    let mut graph = field(12, &text(1, "y"));
    for _ in 0..20_000 {
        let branch = [text(1, "then_branch"), field(6, &graph), int(20, 5)].concat();
        graph = [node("If", &["c"], &["y"], &[branch]), field(12, &text(1, "y"))].concat();
    }
    let bytes = [int(1, 8), field(7, &graph)].concat();
    assert!(matches!(DepthModel::from_bytes(&bytes, None).unwrap_err(), ModelError::TooLarge(_)));
    // A function that calls itself, and functions that each call the next one a hundred times.
    let function = |name: &str, calls: &str, times: usize| {
        let mut body = [text(1, name), text(4, "a"), text(5, "b"), text(10, "own")].concat();
        for index in 0..times {
            let call =
                [text(1, "a"), text(2, if index == 0 { "b" } else { "c" }), text(4, calls), text(7, "own")].concat();
            body.extend(field(7, &call));
        }
        field(25, &body)
    };
    let call = field(1, &[text(1, "x"), text(2, "y"), text(4, "f0"), text(7, "own")].concat());
    let forever = file(std::slice::from_ref(&call), &[function("f0", "f0", 1)]);
    assert!(matches!(run(&forever).unwrap_err(), ModelError::TooLarge(_)));
    let laughs: Vec<Vec<u8>> =
        (0..8).map(|index| function(&format!("f{index}"), &format!("f{}", index + 1), 100)).collect();
    assert!(matches!(run(&file(&[call], &laughs)).unwrap_err(), ModelError::TooLarge(_)));
    // A cycle of nodes, and a chain longer than the stack.
    let cycle = file(
        &[node("Add", &["x", "b"], &["a"], &[]), node("Relu", &["a"], &["b"], &[]), node("Relu", &["a"], &["y"], &[])],
        &[],
    );
    assert!(matches!(run(&cycle).unwrap_err(), ModelError::Malformed(_)));
    let chain = |count: usize| {
        let mut nodes = vec![node("Relu", &["x"], &["n0"], &[])];
        nodes.extend((1..count).map(|at| node("Relu", &[&format!("n{}", at - 1)], &[&format!("n{at}")], &[])));
        nodes.push(node("ReduceMax", &[&format!("n{}", count - 1)], &["y"], &[attribute_int("keepdims", 1)]));
        run(&file(&nodes, &[])).unwrap_err()
    };
    // The longest chain that runs has one number as its output, which is not an image.
    assert!(matches!(chain(9_999), ModelError::Output { .. }));
    assert!(matches!(chain(40_000), ModelError::TooLarge(_)));
    assert!(peak_bytes() < 1 << 30, "{}", peak_bytes());
}

#[test]
fn tensors_match_their_declared_size() {
    let add = node("Add", &["x", "w"], &["y"], &[]);
    let tensor = |dims: &[u64], element: u64, data: Vec<u8>| {
        let dims = dims.iter().flat_map(|&dim| int(1, dim)).collect::<Vec<u8>>();
        field(5, &[dims, int(2, element), text(8, "w"), data].concat())
    };
    for (dims, element, data) in [
        (&[1u64 << 40, 1 << 40][..], 1, Vec::new()),
        (&[1 << 34], 1, Vec::new()),
        (&[u64::MAX], 1, Vec::new()),
        (&[2], 1, field(9, &[0; 4])),
        (&[2], 8, field(9, &[0; 8])),
        (&[1; 40], 1, field(9, &[0; 4])),
    ] {
        let error = run(&file(&[tensor(dims, element, data), add.clone()], &[])).unwrap_err();
        let named = matches!(error, ModelError::TooLarge(_) | ModelError::Malformed(_) | ModelError::Unsupported(_));
        assert!(named, "{error}");
    }
    // A length beyond the end of the file.
    let mut bytes = file(&[tensor(&[4], 1, field(9, &[0; 16])), add], &[]);
    bytes.truncate(bytes.len() - 40);
    assert!(matches!(run(&bytes).unwrap_err(), ModelError::Malformed(_)));
    assert!(matches!(run(b"").unwrap_err(), ModelError::Malformed(_)));
    assert!(matches!(run(b"\x89PNG\r\n\x1a\n and so on").unwrap_err(), ModelError::Malformed(_)));
}

#[test]
fn external_weights_stay_in_the_models_folder() {
    let folder = tempfile::tempdir().unwrap();
    let (inside, secret) = (folder.path().join("models"), folder.path().join("secret.data"));
    std::fs::create_dir(&inside).unwrap();
    std::fs::write(&secret, [0u8; 4096]).unwrap();
    std::fs::write(inside.join("short.data"), [0u8; 8]).unwrap();
    #[cfg(unix)]
    std::os::unix::fs::symlink(&secret, inside.join("link.data")).unwrap();
    let external = |location: &str| {
        let entry = |key: &str, value: &str| field(13, &[text(1, key), text(2, value)].concat());
        let tensor =
            [int(1, 28), int(2, 1), text(8, "w"), entry("location", location), entry("length", "112"), int(14, 1)]
                .concat();
        file(&[field(5, &tensor), node("Add", &["x", "w"], &["y"], &[])], &[])
    };
    let absolute = secret.to_str().unwrap().to_owned();
    for location in [
        "../secret.data",
        "./../secret.data",
        &absolute,
        "link.data",
        "short.data",
        "absent.data",
        "",
        ".",
        "/dev/zero",
    ] {
        let path = inside.join("model.onnx");
        std::fs::write(&path, external(location)).unwrap();
        let error = DepthModel::read(&path, None).unwrap_err();
        assert!(matches!(error, ModelError::External { .. }), "{location}: {error}");
        println!("{error}");
    }
}

fn fixtures() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures")
}

/// Changes, truncates, duplicates and mixes bytes, from a seed.
fn mutated(files: &[Vec<u8>], seed: u64) -> Vec<u8> {
    let mut state = seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1;
    let mut next = |below: usize| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 11) as usize % below.max(1)
    };
    let mut bytes = files[next(files.len())].clone();
    for _ in 0..1 + next(4) {
        let at = next(bytes.len());
        match next(6) {
            0 => bytes[at] = next(256) as u8,
            1 => bytes[at] ^= 1 << next(8),
            2 => bytes[at] = [0, 1, 0x7f, 0x80, 0xff][next(5)],
            3 => bytes.truncate(at + 1),
            4 => {
                let part = bytes[at..(at + next(64)).min(bytes.len())].to_vec();
                let to = next(bytes.len());
                bytes.splice(to..to, part);
            }
            _ => {
                let other = &files[next(files.len())];
                let from = next(other.len());
                let part = &other[from..(from + next(64)).min(other.len())];
                let end = (at + part.len()).min(bytes.len());
                bytes.splice(at..end, part.iter().copied());
            }
        }
    }
    bytes
}

fn survive(seeds: std::ops::Range<u64>) {
    let small =
        |path: &PathBuf| path.extension().is_some_and(|end| end == "onnx") && path.metadata().unwrap().len() < 3000;
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(fixtures()).unwrap().map(|entry| entry.unwrap().path()).filter(small).collect();
    paths.sort();
    let files: Vec<Vec<u8>> = paths.iter().map(|path| std::fs::read(path).unwrap()).collect();
    let config = ModelConfig::parse("kind = \"metric\"\nsize = { rule = \"fixed\", width = 28, height = 14 }").unwrap();
    let (mut ran, mut panicked) = (0, 0);
    for seed in seeds {
        let bytes = mutated(&files, seed);
        let known = match DepthModel::from_bytes(&bytes, None) {
            Err(ModelError::Unknown { .. }) => DepthModel::from_bytes(&bytes, Some(&config)),
            known => known,
        };
        match known.and_then(predicted) {
            Ok(_) => ran += 1,
            Err(error) if error.to_string().contains("internal error in rten") => {
                panicked += 1;
                println!("seed {seed}: {error}");
            }
            Err(_) => {}
        }
    }
    println!("{ran} ran, {panicked} ended in a caught panic of rten; peak memory {} MB", peak_bytes() >> 20);
    assert!(peak_bytes() < 2 << 30, "{}", peak_bytes());
}

#[test]
fn damaged_files_are_errors_or_still_models() {
    survive(0..2000);
}

#[test]
#[ignore = "minutes: cargo test --release -p lo_depth_models --test it hostile:: -- --ignored"]
fn many_damaged_files_are_errors_or_still_models() {
    survive(2000..200_000);
}
