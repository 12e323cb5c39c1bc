//! Answers of participants, as the page saves them.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use crate::{Key, Side};

/// Columns of a file of answers.
const COLUMNS: [&str; 6] = ["study", "participant", "pair", "position", "choice", "seconds"];

/// Largest size of a file of answers, bytes.
const MAX_BYTES: u64 = 16 << 20;

/// Longest code of a participant, as on the page.
const MAX_PARTICIPANT: usize = 32;

/// A participant's choice in one pair.
#[derive(Clone, Debug, PartialEq)]
pub struct Answer {
    /// Code of the participant.
    pub participant: String,
    /// Index of the pair in the key.
    pub pair: usize,
    /// The chosen side.
    pub choice: Side,
    /// Time from the beginning of the videos to the choice.
    pub seconds: f64,
}

/// Answers cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum AnswerError {
    /// A file cannot be read.
    #[error("cannot read {path}: {source}")]
    Io {
        /// Path.
        path: PathBuf,
        /// Cause.
        source: std::io::Error,
    },
    /// A line is malformed, or contradicts the key or another answer.
    #[error("{path}, line {line}: {reason}")]
    Line {
        /// Path.
        path: PathBuf,
        /// Number of the line, from 1.
        line: u64,
        /// Description of the fault.
        reason: String,
    },
}

/// Reads files of answers and checks them against the key and each other.
///
/// # Errors
/// Unreadable files, malformed lines, answers of another study, unknown pairs, and pairs that a participant answered
/// twice. The error names file and line.
pub fn read_answers(key: &Key, files: &[PathBuf]) -> Result<Vec<Answer>, AnswerError> {
    let mut answers = Answers { key, all: Vec::new(), origins: HashMap::new() };
    for path in files {
        let text = lo_imaging::read_regular_text(path, MAX_BYTES)
            .map_err(|source| AnswerError::Io { path: path.clone(), source })?;
        answers.add(path, &text).map_err(|(line, reason)| AnswerError::Line { path: path.clone(), line, reason })?;
    }
    Ok(answers.all)
}

/// Line of a file and what is wrong with it.
type Fault = (u64, String);

struct Answers<'a> {
    key: &'a Key,
    all: Vec<Answer>,
    /// Participant and pair → file and line of the answer.
    origins: HashMap<(String, usize), (PathBuf, u64)>,
}

impl Answers<'_> {
    fn add(&mut self, path: &Path, text: &str) -> Result<(), Fault> {
        let mut reader = csv::ReaderBuilder::new()
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        let mut records = reader.records();
        let header = records.next().transpose().map_err(fault)?.unwrap_or_default();
        if header.iter().ne(COLUMNS) {
            return Err((1, format!("expected the columns {}", COLUMNS.join(","))));
        }
        for record in records {
            let record = record.map_err(fault)?;
            let line = record.position().map_or(0, csv::Position::line);
            let answer = self.parse(&record).map_err(|reason| (line, reason))?;
            let place = (answer.participant.clone(), answer.pair);
            if let Some((file, line_before)) = self.origins.insert(place, (path.to_owned(), line)) {
                let (participant, pair) = (&answer.participant, &self.key.pairs[answer.pair].id);
                let before = format!("{}, line {line_before}", file.display());
                return Err((line, format!("participant {participant} has answered pair {pair} before: {before}")));
            }
            self.all.push(answer);
        }
        Ok(())
    }

    fn parse(&self, record: &csv::StringRecord) -> Result<Answer, String> {
        let cells: Vec<&str> = record.iter().collect();
        let &[study, participant, pair, position, choice, seconds] = &cells[..] else {
            return Err(format!("expected {} cells, got {}", COLUMNS.len(), cells.len()));
        };
        if study != self.key.study {
            return Err(format!("this is an answer of the study {study}, not of {}", self.key.study));
        }
        let is_code = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if participant.is_empty() || participant.len() > MAX_PARTICIPANT || !participant.chars().all(is_code) {
            return Err(format!(
                "the participant is \"{participant}\", not 1 to {MAX_PARTICIPANT} letters, digits, - and _"
            ));
        }
        let count = self.key.pairs.len();
        let index = self.key.pairs.iter().position(|known| known.id == pair);
        let index = index.ok_or_else(|| format!("the study has no pair \"{pair}\""))?;
        if !position.parse().is_ok_and(|position: usize| (1..=count).contains(&position)) {
            return Err(format!("the position is \"{position}\", not a number from 1 to {count}"));
        }
        let in_range = |seconds: &f64| (0.0..1e7).contains(seconds);
        let seconds = seconds
            .parse()
            .ok()
            .filter(in_range)
            .ok_or_else(|| format!("the time is \"{seconds}\", not a number of seconds"))?;
        Ok(Answer { participant: participant.to_owned(), pair: index, choice: choice.parse()?, seconds })
    }
}

fn fault(error: csv::Error) -> Fault {
    (error.position().map_or(1, csv::Position::line), error.to_string())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::Pair;

    fn key() -> Key {
        let pair = |id: &str| Pair {
            id: id.to_owned(),
            room: "room".to_owned(),
            other: "single-map".to_owned(),
            ours: Side::Left,
            left: "a".to_owned(),
            middle: "b".to_owned(),
            right: "c".to_owned(),
        };
        Key {
            study: "0123".to_owned(),
            ours: "fitted".to_owned(),
            others: vec!["single-map".to_owned()],
            reference: "true-octree".to_owned(),
            pairs: ["1", "2"].map(pair).to_vec(),
            videos: Vec::new(),
        }
    }

    fn read(texts: &[&str]) -> Result<Vec<Answer>, String> {
        let folder = tempfile::tempdir().unwrap();
        let files: Vec<PathBuf> = (0..texts.len()).map(|i| folder.path().join(format!("{i}.csv"))).collect();
        for (file, text) in files.iter().zip(texts) {
            std::fs::write(file, text).unwrap();
        }
        let without_folder = |text: String| text.replace(&format!("{}/", folder.path().display()), "");
        read_answers(&key(), &files).map_err(|error| without_folder(error.to_string()))
    }

    const HEADER: &str = "study,participant,pair,position,choice,seconds\n";

    #[test]
    fn answers_are_read_with_any_line_ends() {
        let text = "\u{feff}study,participant,pair,position,choice,seconds\r\n0123,p-1,2,1,left,4.25\r\n0123,p-1,1,2,right,3\r\n";
        let answer = |pair, choice, seconds| Answer { participant: "p-1".into(), pair, choice, seconds };
        assert_eq!(read(&[text]).unwrap(), [answer(1, Side::Left, 4.25), answer(0, Side::Right, 3.0)]);
        assert_eq!(read(&[HEADER]).unwrap(), []);
    }

    #[test]
    fn faults_are_named_with_file_and_line() {
        let with_row = |row: &str| read(&[&format!("{HEADER}0123,a,1,1,left,3\n{row}\n")]).unwrap_err();
        for (row, message) in [
            ("0124,a,2,2,left,3", "this is an answer of the study 0124, not of 0123"),
            ("0123,a,3,2,left,3", "the study has no pair \"3\""),
            ("0123,a,2,2,middle,3", "the choice is \"middle\", not left or right"),
            ("0123,a,2,0,left,3", "the position is \"0\", not a number from 1 to 2"),
            ("0123,a,2,2,left,-1", "the time is \"-1\", not a number of seconds"),
            ("0123,a,2,2,left,NaN", "the time is \"NaN\", not a number of seconds"),
            ("0123,=1+1,2,2,left,3", "the participant is \"=1+1\", not 1 to 32 letters, digits, - and _"),
            ("0123,a,2,2,left", "expected 6 cells, got 5"),
            ("0123,a,1,2,left,3", "participant a has answered pair 1 before: 0.csv, line 2"),
        ] {
            assert_eq!(with_row(row), format!("0.csv, line 3: {message}"));
        }
        let columns = "0.csv, line 1: expected the columns study,participant,pair,position,choice,seconds";
        assert_eq!(read(&["0123,a,1,1,left,3\n"]).unwrap_err(), columns);
        assert_eq!(read(&[""]).unwrap_err(), columns);
        let twice = format!("{HEADER}0123,a,1,1,left,3\n");
        assert_eq!(
            read(&[&twice, &twice]).unwrap_err(),
            "1.csv, line 2: participant a has answered pair 1 before: 0.csv, line 2"
        );
        let error = read_answers(&key(), &["missing.csv".into()]).unwrap_err();
        assert!(error.to_string().starts_with("cannot read missing.csv: "), "{error}");
    }
}
