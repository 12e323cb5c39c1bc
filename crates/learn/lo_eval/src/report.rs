//! Results of an evaluation, as data and tables.

use std::collections::BTreeMap;

use crate::{Cost, EvalError, Sheet, Summary};

/// Results of an evaluation.
#[derive(Debug)]
pub struct Report {
    /// Names of the methods and other programs, in the order of the sheet's columns.
    pub methods: Vec<String>,
    /// All outcomes.
    pub summary: Summary,
    /// Contact sheet.
    pub sheet: Sheet,
    /// Contact sheet of objects inserted into the photos; empty if none were.
    pub objects: Sheet,
    /// Reasons for photos without objects, and their numbers.
    pub without_objects: BTreeMap<String, usize>,
    /// Number of photos evaluated.
    pub photos: usize,
    /// Number of photos requested.
    pub asked: usize,
    /// The error that ended the evaluation.
    pub error: Option<EvalError>,
}

impl Report {
    /// Returns the order of the sheet's columns and all tables, in Markdown.
    pub fn markdown(&self) -> String {
        let methods = self.methods.join(", ");
        let mut order = format!("sheet.png, from left to right: photo, truth, {methods}\n\n");
        if !self.objects.is_empty() {
            order += &format!("objects.png, from left to right: photo, lit by the truth, {methods}\n\n");
        }
        if self.photos < self.asked {
            order += &format!("**Incomplete**: {} of {} photos\n\n", self.photos, self.asked);
        }
        for (reason, count) in &self.without_objects {
            order += &format!("photos without objects: {count}, {reason}\n\n");
        }
        order + &self.summary.markdown() + &self.summary.cost_markdown()
    }

    /// Returns a CSV record for each photo and method; missing figures are empty.
    pub fn scenes_csv(&self) -> String {
        let figures = self.summary.figures();
        let head = ["scene", "photo", "method", "not_possible"].map(str::to_owned);
        let mut text = csv_record(head.into_iter().chain(figures.iter().cloned()));
        for outcome in self.summary.outcomes() {
            let (scores, reason) = match &outcome.scores {
                Ok(scores) => (Some(scores), String::new()),
                Err(reason) => (None, reason.to_string()),
            };
            let value = |figure: &String| scores.and_then(|scores| scores.get(figure)).map(|v| format!("{v:.6}"));
            let start = [outcome.scene.clone(), outcome.sample.clone(), outcome.method.clone(), reason];
            text +=
                &csv_record(start.into_iter().chain(figures.iter().map(|figure| value(figure).unwrap_or_default())));
        }
        text
    }

    /// Returns time and memory of each method on each photo, as CSV.
    pub fn costs_csv(&self) -> String {
        let mut text = csv_record(["photo", "method", "estimate_s", "panorama_s", "peak_mib"].map(str::to_owned));
        for outcome in self.summary.outcomes().iter().filter(|outcome| outcome.scores.is_ok()) {
            let Some(Cost { estimate_s, panorama_s, peak_mib }) = outcome.cost else { continue };
            let peak = peak_mib.map_or_else(String::new, |mib| format!("{mib:.1}"));
            let numbers = [format!("{estimate_s:.6}"), format!("{panorama_s:.6}"), peak];
            text += &csv_record([outcome.sample.clone(), outcome.method.clone()].into_iter().chain(numbers));
        }
        text
    }
}

/// Formats an RFC 4180 record that ends in LF.
fn csv_record(cells: impl IntoIterator<Item = String>) -> String {
    let quoted = |cell: String| {
        if cell.contains([',', '"', '\n', '\r']) { format!("\"{}\"", cell.replace('"', "\"\"")) } else { cell }
    };
    cells.into_iter().map(quoted).collect::<Vec<_>>().join(",") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Method, MethodError, Outcome, Scores};

    #[test]
    fn tables_hold_every_outcome() {
        let scores = Scores::from_iter([("psnr_db".to_owned(), 12.5)]);
        let cost = Cost { estimate_s: 1.5, panorama_s: 0.25, peak_mib: Some(99.04) };
        let outcome = |method: &str, scores| Outcome {
            sample: "a \"small\" room, 1".into(),
            scene: "a".into(),
            method: method.to_owned(),
            condition: None,
            scores,
            cost: Some(cost),
        };
        let mut summary = Summary::default();
        summary.add(outcome("network", Ok(scores)));
        summary.add(outcome("shell-true", Err(MethodError::Needs("true depth"))));
        let sheet = Sheet::default();
        let methods = vec![Method::Network(None).name().to_owned()];
        let (objects, without_objects) = (Sheet::default(), BTreeMap::new());
        let report = Report { methods, summary, sheet, objects, without_objects, photos: 1, asked: 2, error: None };
        let name = "\"a \"\"small\"\" room, 1\"";
        assert_eq!(
            report.scenes_csv(),
            format!(
                "scene,photo,method,not_possible,psnr_db\na,{name},network,,12.500000\na,{name},shell-true,needs true depth,\n"
            )
        );
        let costs = format!("photo,method,estimate_s,panorama_s,peak_mib\n{name},network,1.500000,0.250000,99.0\n");
        assert_eq!(report.costs_csv(), costs);
        assert!(report.markdown().starts_with(
            "sheet.png, from left to right: photo, truth, network\n\n**Incomplete**: 1 of 2 photos\n\n###"
        ));
    }
}
