//! Checks that commands in documents, `--help` and comments of configurations parse, for this program and
//! `lightoctree`.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use lightoctree_lab::cli::Cli;

use crate::support::done;

/// The default program of `cargo run`, and the other one.
const PROGRAMS: [&str; 2] = ["lightoctree", "lightoctree-lab"];

/// A documented command.
struct Command {
    /// File or help text that contains it.
    source: String,
    words: Vec<String>,
    /// Whether the command is complete, as in code blocks and `--help`. In running text, values may be omitted or
    /// placeholders (`--threads T`).
    is_whole: bool,
}

#[test]
fn documented_commands_parse() {
    let documents = files(&root(), ".md");
    let mut commands: Vec<_> =
        documents.iter().flat_map(|path| in_document(&path.display().to_string(), &text(path))).collect();
    let counts = [true, false].map(|is_whole| commands.iter().filter(|command| command.is_whole == is_whole).count());
    assert!(counts[0] >= 10 && counts[1] >= 10, "commands in blocks and in text: {counts:?}");
    commands.extend(in_help(&Cli::command()));
    commands.extend(in_help(&lightoctree_cli::cli::Cli::command()));
    commands.extend(in_comments_of_configurations());
    let faults: Vec<_> = commands.iter().filter_map(fault).collect();
    assert!(faults.is_empty(), "\n{}\n", faults.join("\n"));
}

#[test]
fn documented_commands_that_do_not_exist_are_found() {
    let faults = |document: &str| in_document("a.md", document).iter().filter_map(fault).count();
    assert_eq!(
        faults(
            "```sh\n# a comment\nX=1 lightoctree inspect 'room a.scene' | jq .octree > a.json && lightoctree demo  # all of it\n```"
        ),
        0
    );
    assert_eq!(
        faults(
            "```sh\ncargo run --release -- demo\nlightoctree inspect \\\n    room.scene\n```\n`lightoctree-lab bench --threads T`"
        ),
        0
    );
    assert_eq!(
        faults(
            "```sh\nlightoctree inspect room.scene --deep\nlightoctree look\ncargo run --release -- demonstrate\ncargo run -p lightoctree-lab -- demo\n```"
        ),
        4
    );
    assert_eq!(
        faults(
            "```sh\nlightoctree envmap room.scene -o a.exr --at nowhere\nlightoctree inspect a.scene && lightoctree envmap\n```"
        ),
        2
    );
    assert_eq!(
        faults(
            "`lightoctree inspect --deep`, `lightoctree look`, `lightoctree eval rooms`, `lightoctree\nlook`, `lightoctree` and `lightoctree::estimate`"
        ),
        4
    );
}

/// Every configuration is used by a documented `synth`, `train`, `train-baseline`, `eval` or `study make` command, and
/// parses.
#[test]
fn configurations_parse() {
    let folder = tempfile::tempdir().unwrap();
    let configurations = files(&root().join("configs"), ".toml");
    assert!(configurations.len() >= 3);
    let documents = files(&root(), ".md");
    let mut commands: Vec<_> = documents.iter().flat_map(|path| in_document("", &text(path))).collect();
    commands.extend(in_comments_of_configurations());
    for path in configurations {
        let name = path.strip_prefix(root()).unwrap().to_string_lossy().replace('\\', "/");
        let uses = commands.iter().filter(|command| command.words.contains(&name));
        let uses: BTreeSet<_> = uses.map(|command| command.words[1].as_str()).collect();
        assert!(!uses.is_empty(), "no documented command uses {name}");
        for command in uses {
            let path = path.to_str().unwrap();
            let args: &[&str] = match command {
                "study" => &["study", "make", path],
                // `eval` takes rooms as `synth` does.
                "eval" => &["synth", "--config", path],
                command => &[command, "--config", path],
            };
            done(folder.path(), &[args, &["--print-config"]].concat());
        }
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap()
}

fn text(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap()
}

/// Finds files by extension below a folder, except build outputs.
fn files(folder: &Path, end: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in folder.read_dir().unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        if path.is_symlink() || name.starts_with('.') || ["target", "out"].contains(&name.as_str()) {
            continue;
        }
        if path.is_dir() {
            found.extend(files(&path, end));
        } else if name.ends_with(end) {
            found.push(path);
        }
    }
    found.sort();
    found
}

fn in_document(source: &str, document: &str) -> Vec<Command> {
    let mut commands = Vec::new();
    // Every second part is a code block.
    for (index, part) in document.split("```").enumerate() {
        if index % 2 == 1 {
            commands.extend(in_block(source, part));
        } else {
            // A code span may contain a line break.
            let spans = part.split('`').skip(1).step_by(2).map(|span| span.replace('\n', " "));
            for span in spans.filter(|span| PROGRAMS.iter().any(|program| span.starts_with(&format!("{program} ")))) {
                commands.extend(split(&span).into_iter().filter_map(|words| command(source, words, false)));
            }
        }
    }
    commands
}

/// Parses shell lines; a line that ends in a backslash continues on the next.
fn in_block(source: &str, block: &str) -> Vec<Command> {
    let lines = block.replace("\\\n", " ");
    lines.lines().flat_map(split).filter_map(|words| command(source, words, true)).collect()
}

fn in_comments_of_configurations() -> Vec<Command> {
    let in_comments = |path: PathBuf| {
        let text = text(&path);
        let comments = text.lines().filter_map(|line| line.strip_prefix('#'));
        in_block(&path.display().to_string(), &comments.collect::<Vec<_>>().join("\n"))
    };
    files(&root().join("configs"), ".toml").into_iter().flat_map(in_comments).collect()
}

fn in_help(program: &clap::Command) -> Vec<Command> {
    let own =
        program.get_after_help().map(|help| in_block(&format!("--help of {}", program.get_name()), &help.to_string()));
    own.into_iter().flatten().chain(program.get_subcommands().flat_map(in_help)).collect()
}

/// Extracts a command of our programs from shell words: after variables, or after `cargo run … --`.
fn command(source: &str, words: Vec<String>, is_whole: bool) -> Option<Command> {
    let words: Vec<_> =
        words.into_iter().skip_while(|word| word.split_once('=').is_some_and(|(name, _)| is_variable(name))).collect();
    let words = match words.first()?.as_str() {
        program if PROGRAMS.contains(&program) => words,
        "cargo" if words.get(1)? == "run" && !words.contains(&"--example".to_owned()) => {
            let start = words.iter().position(|word| word == "--")?;
            let program = PROGRAMS[usize::from(words[..start].iter().any(|word| word == PROGRAMS[1]))];
            [&[program.to_owned()], &words[start + 1..]].concat()
        }
        _ => return None,
    };
    // In running text, a capitalised word is a placeholder for any command; shell expansions are unknown.
    if !is_whole && words.get(1).is_some_and(|word| is_variable(word)) {
        return None;
    }
    let is_whole = is_whole && !words.iter().any(|word| word.contains('$'));
    Some(Command { source: source.to_owned(), words, is_whole })
}

fn is_variable(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_uppercase() || c.is_ascii_digit() || c == '_')
}

/// Returns why the program rejects a command; `None` if it is valid.
fn fault(command: &Command) -> Option<String> {
    let error = if command.words[0] == PROGRAMS[1] {
        Cli::try_parse_from(&command.words).err()?
    } else {
        lightoctree_cli::cli::Cli::try_parse_from(&command.words).err()?
    };
    let is_abridged = matches!(
        error.kind(),
        ErrorKind::ValueValidation
            | ErrorKind::InvalidValue
            | ErrorKind::MissingRequiredArgument
            | ErrorKind::MissingSubcommand
            | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
    );
    let is_fine = match error.kind() {
        ErrorKind::DisplayHelp | ErrorKind::DisplayVersion => true,
        _ => is_abridged && !command.is_whole,
    };
    (!is_fine).then(|| {
        format!("{}: `{}`: {}", command.source, command.words.join(" "), error.to_string().lines().next().unwrap_or(""))
    })
}

/// Splits a shell line into commands and words.
///
/// Supports quotes, comments, `|`, `&&`, `;`, `>` and `<`; expansions are kept as they are.
fn split(line: &str) -> Vec<Vec<String>> {
    let (mut commands, mut words, mut word) = (Vec::new(), Vec::new(), None::<String>);
    let mut quote = None;
    let mut depth = 0;
    for c in line.chars() {
        match (quote, c) {
            (Some(open), c) if c == open => quote = None,
            (None, '\'' | '"') => {
                quote = Some(c);
                word.get_or_insert_default();
            }
            (None, '(' | ')') => {
                depth += if c == '(' { 1 } else { -1 };
                word.get_or_insert_default().push(c);
            }
            (None, '#') if word.is_none() => break,
            (None, c) if depth == 0 && (c.is_whitespace() || "|&;<>".contains(c)) => {
                words.extend(word.take());
                match c {
                    '|' | '&' | ';' => commands.push(std::mem::take(&mut words)),
                    '<' | '>' => words.push(c.to_string()),
                    _ => (),
                }
            }
            (_, c) => word.get_or_insert_default().push(c),
        }
    }
    words.extend(word);
    commands.push(words);
    // Redirections belong to the shell.
    let of_program =
        |words: Vec<String>| words.into_iter().take_while(|word| word != "<" && word != ">").collect::<Vec<_>>();
    commands.into_iter().map(of_program).filter(|words| !words.is_empty()).collect()
}
