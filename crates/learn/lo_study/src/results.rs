//! Shares and tests of a study's answers.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::binomial::{exact_interval, exact_p_value};
use crate::holm::holm;
use crate::{Answer, Key, Side};

/// Confidence of the intervals.
const CONFIDENCE: f64 = 0.95;

/// Results of a study.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Results {
    /// Identifier of the study.
    pub study: String,
    /// Method under study.
    pub ours: String,
    /// Method of the video in the middle.
    pub reference: String,
    /// Number of participants with answers.
    pub participants: usize,
    /// Number of answers.
    pub answers: u64,
    /// Participants who did not answer all pairs, and how many they answered.
    pub incomplete: BTreeMap<String, usize>,
    /// Answers for the left side, whatever it showed.
    pub left_chosen: u64,
    /// Exact two-sided p-value of that number, against chance.
    pub left_p: f64,
    /// Comparisons in the order of the configuration.
    pub comparisons: Vec<Comparison>,
}

/// Results of our method against another.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Comparison {
    /// The other method.
    pub other: String,
    /// Number of answers.
    pub answers: u64,
    /// Answers for our method.
    pub ours_chosen: u64,
    /// Share of answers for our method; `None` without answers.
    pub share: Option<f64>,
    /// Clopper and Pearson's 95 % interval of that share.
    pub interval: [f64; 2],
    /// Exact two-sided p-value of the binomial test against chance, all answers counted as independent.
    pub p: f64,
    /// This p-value after Holm's correction for the number of comparisons.
    pub p_holm: f64,
    /// Results with one vote for each participant.
    pub by_participant: Participants,
}

/// Results with one vote for each participant: the method that they chose more often.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Participants {
    /// Participants who chose our method more often.
    pub ours: u64,
    /// Participants who chose the other more often.
    pub other: u64,
    /// Participants who chose both equally often. They do not count in the test.
    pub ties: u64,
    /// Exact two-sided p-value of the sign test.
    pub p: f64,
    /// This p-value after Holm's correction for the number of comparisons.
    pub p_holm: f64,
}

impl Results {
    /// Counts and tests answers; each participant has at most one answer for each pair.
    pub fn new(key: &Key, answers: &[Answer]) -> Self {
        let mut per_participant: BTreeMap<&str, usize> = BTreeMap::new();
        for answer in answers {
            *per_participant.entry(&answer.participant).or_default() += 1;
        }
        let left_chosen = answers.iter().filter(|answer| answer.choice == Side::Left).count() as u64;
        let mut comparisons: Vec<Comparison> = key.others.iter().map(|other| compare(key, answers, other)).collect();
        let corrected = |p: fn(&Comparison) -> f64| holm(&comparisons.iter().map(p).collect::<Vec<_>>());
        let by_answer = corrected(|comparison| comparison.p);
        let by_participant = corrected(|comparison| comparison.by_participant.p);
        for ((comparison, p), sign_p) in comparisons.iter_mut().zip(by_answer).zip(by_participant) {
            (comparison.p_holm, comparison.by_participant.p_holm) = (p, sign_p);
        }
        Self {
            study: key.study.clone(),
            ours: key.ours.clone(),
            reference: key.reference.clone(),
            participants: per_participant.len(),
            answers: answers.len() as u64,
            incomplete: per_participant
                .iter()
                .filter(|(_, count)| **count < key.pairs.len())
                .map(|(participant, count)| ((*participant).to_owned(), *count))
                .collect(),
            left_chosen,
            left_p: exact_p_value(left_chosen, answers.len() as u64),
            comparisons,
        }
    }
}

/// Compares our method with another, without correction.
fn compare(key: &Key, answers: &[Answer], other: &str) -> Comparison {
    let votes = answers.iter().filter_map(|answer| {
        let pair = &key.pairs[answer.pair];
        (pair.other == other).then(|| (answer.participant.as_str(), answer.choice == pair.ours))
    });
    let (mut count, mut ours_chosen) = (0, 0);
    let mut balances: BTreeMap<&str, i64> = BTreeMap::new();
    for (participant, is_ours) in votes {
        count += 1;
        ours_chosen += u64::from(is_ours);
        *balances.entry(participant).or_default() += if is_ours { 1 } else { -1 };
    }
    let participants = |sign: i64| balances.values().filter(|balance| balance.signum() == sign).count() as u64;
    let (ours, theirs) = (participants(1), participants(-1));
    Comparison {
        other: other.to_owned(),
        answers: count,
        ours_chosen,
        share: (count > 0).then(|| ours_chosen as f64 / count as f64),
        interval: exact_interval(ours_chosen, count, CONFIDENCE),
        p: exact_p_value(ours_chosen, count),
        p_holm: 1.0,
        by_participant: Participants {
            ours,
            other: theirs,
            ties: participants(0),
            p: exact_p_value(ours, ours + theirs),
            p_holm: 1.0,
        },
    }
}

#[cfg(test)]
pub(crate) mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::Pair;

    /// Returns a study of ten rooms against two methods, ours on alternating sides.
    pub(crate) fn key() -> Key {
        let pair = |number: usize, other: &str| Pair {
            id: format!("{number:02}"),
            room: format!("room-{}", number % 10),
            other: other.to_owned(),
            ours: if number.is_multiple_of(2) { Side::Left } else { Side::Right },
            left: String::new(),
            middle: String::new(),
            right: String::new(),
        };
        let pairs = (0..10).map(|i| pair(i, "single-map")).chain((10..20).map(|i| pair(i, "overhead")));
        Key {
            study: "0123".to_owned(),
            ours: "fitted".to_owned(),
            others: ["single-map", "overhead"].map(str::to_owned).to_vec(),
            reference: "true-octree".to_owned(),
            pairs: pairs.collect(),
            videos: Vec::new(),
        }
    }

    /// Returns the answer of a participant who does or does not choose our method.
    pub(crate) fn answer(key: &Key, participant: &str, pair: usize, is_ours: bool) -> Answer {
        let choice = match (key.pairs[pair].ours, is_ours) {
            (Side::Left, true) | (Side::Right, false) => Side::Left,
            _ => Side::Right,
        };
        Answer { participant: participant.to_owned(), pair, choice, seconds: 4.0 }
    }

    #[test]
    fn shares_and_p_values_are_those_of_the_choices() {
        let key = key();
        // Ten of ten for ours against the first, 18 of 30 against the second.
        let first = (0..10).map(|pair| answer(&key, "a", pair, true));
        let ours_of = [("a", 10), ("b", 5), ("c", 3)];
        let second = ours_of.iter().flat_map(|&(participant, ours)| {
            let key = &key;
            (0..10).map(move |i| answer(key, participant, 10 + i, i < ours))
        });
        let answers: Vec<Answer> = first.chain(second).collect();
        let results = Results::new(&key, &answers);
        assert_eq!((results.participants, results.answers), (3, 40));
        assert_eq!(results.incomplete, BTreeMap::from([("b".to_owned(), 10), ("c".to_owned(), 10)]));
        let [first, second] = &results.comparisons[..] else { panic!() };
        assert_eq!((first.answers, first.ours_chosen, first.share), (10, 10, Some(1.0)));
        // 2 / 2¹⁰, times two comparisons.
        assert!((first.p - 2.0 / 1024.0).abs() < 1e-12 && (first.p_holm - 4.0 / 1024.0).abs() < 1e-12);
        assert_eq!((second.answers, second.ours_chosen, second.share), (30, 18, Some(0.6)));
        assert!((second.p - exact_p_value(18, 30)).abs() < 1e-12 && second.p_holm == second.p);
        assert!(second.interval[0] < 0.5 && second.interval[1] > 0.6);
        // One vote each: a for ours, b for none, c for the other.
        let votes = &second.by_participant;
        assert_eq!((votes.ours, votes.other, votes.ties, votes.p), (1, 1, 1, 1.0));
        assert_eq!((first.by_participant.ours, first.by_participant.p), (1, 1.0));
    }

    #[test]
    fn a_preference_for_a_side_is_no_preference_for_a_method() {
        let key = key();
        let answers: Vec<Answer> = (0..20)
            .map(|pair| Answer { participant: "a".to_owned(), pair, choice: Side::Left, seconds: 1.0 })
            .collect();
        let results = Results::new(&key, &answers);
        assert_eq!((results.left_chosen, results.comparisons[0].share), (20, Some(0.5)));
        assert!((results.left_p - 2.0 / 2_f64.powi(20)).abs() < 1e-15 && results.comparisons[0].p == 1.0);
    }

    #[test]
    fn no_answers_prove_nothing() {
        let results = Results::new(&key(), &[]);
        assert_eq!((results.participants, results.left_p), (0, 1.0));
        let comparison = &results.comparisons[1];
        assert_eq!((comparison.share, comparison.p, comparison.interval), (None, 1.0, [0.0, 1.0]));
    }
}
