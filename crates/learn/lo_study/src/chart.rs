//! Bar chart of the answers, as in figure 6 of the paper.

use std::fmt::Display;

use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

use crate::{Comparison, Results};

/// Width of a comparison and of the margins, and height of the chart, pixels.
const GROUP_WIDTH: u32 = 170;
const SIDE_WIDTH: u32 = 124;
const HEIGHT: u32 = 380;

/// Smallest width of the chart: that of its title.
const MIN_WIDTH: u32 = 420;

/// Half the width of a bar, of a comparison's width 1.
const HALF_BAR: f64 = 0.17;

/// Distance of a bar's middle from that of its comparison.
const BAR_OFFSET: f64 = 0.19;

/// Colours of our method and of the others. They differ in brightness, too.
const OURS: RGBColor = RGBColor(31, 92, 153);
const OTHER: RGBColor = RGBColor(203, 203, 203);

const FONT: &str = "sans-serif";

/// The chart cannot be drawn.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the chart: {0}")]
pub struct ChartError(String);

impl ChartError {
    fn new(source: impl Display) -> Self {
        Self(source.to_string())
    }
}

/// Draws the shares of all comparisons as SVG: ours beside the other, ours with its 95 % interval, below them Holm's
/// p-value. `generator` is the name of the program, kept in a comment.
///
/// # Errors
/// Internal errors of the drawing library.
pub fn chart(results: &Results, generator: &str) -> Result<String, ChartError> {
    let mut svg = String::new();
    draw(results, &mut svg)?;
    // A comment may not contain two hyphens.
    Ok(format!("<!-- {} -->\n{svg}", generator.replace("--", "- -")))
}

fn draw(results: &Results, svg: &mut String) -> Result<(), ChartError> {
    let count = results.comparisons.len();
    let width = (GROUP_WIDTH * count as u32 + SIDE_WIDTH).max(MIN_WIDTH);
    let root = SVGBackend::with_string(svg, (width, HEIGHT)).into_drawing_area();
    root.fill(&WHITE).map_err(ChartError::new)?;
    let mut chart = ChartBuilder::on(&root)
        .margin(12)
        .margin_top(44)
        .margin_right(56)
        .x_label_area_size(62)
        .y_label_area_size(56)
        .build_cartesian_2d(0.0..count as f64, 0.0..100.0)
        .map_err(ChartError::new)?;
    chart
        .configure_mesh()
        .disable_x_mesh()
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .x_labels(0)
        .y_labels(6)
        .y_label_formatter(&|percent| format!("{percent:.0}"))
        .y_desc("answers, %")
        .axis_desc_style((FONT, 15))
        .label_style((FONT, 14))
        .draw()
        .map_err(ChartError::new)?;
    for (i, comparison) in results.comparisons.iter().enumerate() {
        let Some(share) = comparison.share else { continue };
        let middle = i as f64 + 0.5;
        let (ours, other) = (100.0 * share, 100.0 * (1.0 - share));
        let bar = |x: f64, percent: f64, colour: RGBColor| {
            Rectangle::new([(x - HALF_BAR, 0.0), (x + HALF_BAR, percent)], colour.filled())
        };
        let bars = [bar(middle - BAR_OFFSET, ours, OURS), bar(middle + BAR_OFFSET, other, OTHER)];
        chart.draw_series(bars).map_err(ChartError::new)?;
        chart.draw_series(whisker(middle - BAR_OFFSET, comparison.interval)).map_err(ChartError::new)?;
    }
    let chance = PathElement::new([(0.0, 50.0), (count as f64, 50.0)], BLACK.mix(0.5));
    chart.draw_series([chance]).map_err(ChartError::new)?;
    for (i, comparison) in results.comparisons.iter().enumerate() {
        let (middle, _) = chart.backend_coord(&(i as f64 + 0.5, 0.0));
        let (_, bottom) = chart.backend_coord(&(0.0, 0.0));
        let lines = [
            (16, format!("{} : {}", results.ours, comparison.other), 14),
            (34, percentages(comparison), 14),
            (52, p_text(comparison), 13),
        ];
        for (below, text, size) in lines {
            root.draw(&centred(text, (middle, bottom + below), size)).map_err(ChartError::new)?;
        }
    }
    let (end, height) = chart.backend_coord(&(count as f64, 50.0));
    root.draw(&centred("chance".to_owned(), (end + 26, height), 13)).map_err(ChartError::new)?;
    let title =
        format!("closer to the reference (participants: {}, answers: {})", results.participants, results.answers);
    root.draw(&centred(title, (width as i32 / 2, 22), 15)).map_err(ChartError::new)?;
    root.present().map_err(ChartError::new)
}

/// Returns the lines of an interval around x.
fn whisker(x: f64, [low, high]: [f64; 2]) -> impl Iterator<Item = PathElement<(f64, f64)>> {
    let (low, high) = (100.0 * low, 100.0 * high);
    let end = move |y: f64| [(x - 0.04, y), (x + 0.04, y)];
    let lines = [[(x, low), (x, high)], end(low), end(high)];
    lines.into_iter().map(|line| PathElement::new(line, BLACK.stroke_width(2)))
}

fn centred(text: String, position: (i32, i32), size: i32) -> Text<'static, (i32, i32), String> {
    let style = (FONT, size).into_text_style(&(u32::MAX, u32::MAX)).pos(Pos::new(HPos::Center, VPos::Center));
    Text::new(text, position, style)
}

fn percentages(comparison: &Comparison) -> String {
    match comparison.share {
        Some(share) => format!("{:.1} % : {:.1} %", 100.0 * share, 100.0 * (1.0 - share)),
        None => "no answers".to_owned(),
    }
}

fn p_text(comparison: &Comparison) -> String {
    let p = comparison.p_holm;
    if p < 0.001 { "p < 0.001".to_owned() } else { format!("p = {p:.3}") }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;
    use crate::results::tests::{answer, key};

    #[test]
    fn bars_are_as_high_as_the_shares() {
        let key = key();
        let mut answers: Vec<_> = (0..10).map(|pair| answer(&key, "a", pair, true)).collect();
        answers.extend((10..20).map(|pair| answer(&key, "a", pair, pair < 16)));
        let svg = chart(&Results::new(&key, &answers), "lightoctree study").unwrap();
        assert!(svg.starts_with("<!-- lightoctree study -->\n<svg "), "{svg}");
        for text in
            ["fitted : overhead", "60.0 % : 40.0 %", "100.0 % : 0.0 %", "p = 0.004", "participants: 1, answers: 20"]
        {
            assert!(svg.contains(text), "{text}: {svg}");
        }
        let heights = |colour: &str| -> Vec<f64> {
            let bars = svg.lines().filter(|line| line.starts_with("<rect") && line.contains(colour));
            let height =
                |line: &str| line.split("height=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap();
            bars.map(height).collect()
        };
        let (ours, others) = (heights("#1F5C99"), heights("#CBCBCB"));
        assert_eq!((ours.len(), others.len()), (2, 2));
        // Bars are rounded to pixels; 100 % are about 260.
        assert!(
            (ours[1] / ours[0] - 0.6).abs() < 0.01 && (others[1] / ours[0] - 0.4).abs() < 0.01,
            "{ours:?} {others:?}"
        );
        assert!(others[0] <= 1.0, "{others:?}");
    }

    #[test]
    fn comparisons_without_answers_have_no_bars() {
        let svg = chart(&Results::new(&key(), &[]), "lightoctree study -- x").unwrap();
        assert!(svg.contains("no answers") && !svg.contains("#1F5C99"), "{svg}");
        assert!(svg.starts_with("<!-- lightoctree study - - x -->"), "{svg}");
    }
}
