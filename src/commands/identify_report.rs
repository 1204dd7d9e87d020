//! `resonarm identify --report`: one HTML file with the modes, their figures and the recordings they are from.

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use nalgebra::Complex;
use sha2::{Digest, Sha256};

use super::identify::{Document, Levels, Run};
use super::identify_figures::{Curve, poles_figure, responses_figure};
use super::identify_found::{Found, NumberedMode, noise_name, signed};
use crate::failure::Failure;
use crate::junit::without_markup;
use resonarm::identify::{IdentifiedMode, ReadingNoise};
use resonarm::modal;
use resonarm::survey::SurveyRun;
use resonarm_figures::plot::{Figure, Subtitle};
use resonarm_numeric::number::short;

const STYLE: &str = include_str!("report.css");
/// Most responses that are drawn: more would be too many to look at.
const MOST_DRAWN: usize = 12;
/// Most dots of a measured response in a panel.
const MOST_DOTS: usize = 400;

/// Writes the report as HTML. It loads nothing: figures are inline, and the policy forbids everything but its own style.
pub(super) fn page(document: &Document, of: &Subtitle) -> Result<String, Failure> {
    let title = if of.line.is_empty() { String::from("Modal report") } else { format!("Modal report: {}", of.line) };
    // The policy allows the style by its hash, and with it no other style and no script.
    let hash = STANDARD.encode(Sha256::digest(STYLE.as_bytes()));
    let title = escaped(&title);
    let mut page = format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'sha256-{hash}'; base-uri 'none'; form-action 'none'\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>{title}</title>\n<style>{STYLE}</style>\n\
         </head>\n<body>\n<main>\n<h1>{title}</h1>\n"
    );
    page += &summary(document);
    let found = &document.found;
    page += &modes(found);
    if !document.missing.is_empty() {
        page += "<h2>Modes that were not found</h2>\n<ul>\n";
        for missing in &document.missing {
            page += &format!("<li>{}</li>\n", escaped(&missing.to_string()));
        }
        page += "</ul>\n";
    }
    page += &document.levels.iter().map(levels).collect::<String>();
    page += &shapes(found);
    page += &own_assurance(found);
    if let Some(mac) = &found.mac {
        page += &format!("<h2>Against {}</h2>\n", escaped(&mac.others()));
        page += &figure(
            mac.figure(),
            "MAC of the shapes with these modes: 1 of shapes that are alike, 0 of orthogonal ones.",
        )?;
    }
    let all = document.curves();
    page += "<h2>Poles over the order</h2>\n";
    page += &figure(
        poles_figure(found, &all),
        "Poles of polynomial models of rising order. The fit starts from those that come again; the fitted modes are dashed.",
    )?;
    page += &responses(document)?;
    page += &noise(found, document.runs.len() > 1);
    page += &runs(document);
    Ok(page + "</main>\n</body>\n</html>\n")
}

/// Returns text with markup characters escaped, and control characters replaced: HTML has none.
fn escaped(text: &str) -> String {
    without_markup(&text.replace(char::is_control, "\u{fffd}"))
}

fn summary(document: &Document) -> String {
    let modes = document.found.modes.len();
    let runs = document.runs.len();
    let plural = |count: usize| if count == 1 { "" } else { "s" };
    let mut text = format!(
        "<p>{modes} mode{} from {} to {} Hz, fitted to {runs} recording{} by maximum likelihood, with common poles. A value is followed \
         by its standard deviation; a dash says that none can be stated, and the remarks say why.</p>\n",
        plural(modes),
        short(&document.found.from_hz),
        short(&document.found.to_hz),
        plural(runs)
    );
    let left_out = document.survey.iter().flat_map(|survey| &survey.plan).flat_map(|plan| &plan.left_out);
    let rigid: Vec<String> = left_out.filter(|left| left.place == "rigid").map(|left| left.mode.to_string()).collect();
    if !rigid.is_empty() {
        text += &format!("<p>Rigid modes are below the band, and left out: {}.</p>\n", rigid.join(", "));
    }
    text
}

/// Columns of numbers that have no text.
const NO_TEXT: &[&str] = &[];

/// Returns a table that scrolls by itself where it is wider than the page. `rows` are cells with their tags; the columns of
/// `text` are those whose cells are aligned to the left, as the first one always is.
fn table(caption: &str, head: &[&str], text: &[&str], rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let column = |name: &&str| {
        let class = if text.contains(name) { " class=\"name\"" } else { "" };
        format!("<th scope=\"col\"{class}>{}</th>", escaped(name))
    };
    let head: String = head.iter().map(column).collect();
    let rows: String = rows.into_iter().map(|row| format!("<tr>{}</tr>\n", row.concat())).collect();
    let caption = escaped(caption);
    format!(
        // With a tab index the keyboard scrolls a wide table, too.
        "<div class=\"wide\" tabindex=\"0\" role=\"region\" aria-label=\"{caption}\">\n<p class=\"note\">{caption}</p>\n<table>\n\
         <thead><tr>{head}</tr></thead>\n<tbody>\n{rows}</tbody>\n</table>\n</div>\n"
    )
}

fn cell(text: &str) -> String {
    format!("<td>{}</td>", escaped(text))
}

fn name(text: &str) -> String {
    format!("<th scope=\"row\" class=\"name\">{}</th>", escaped(text))
}

fn with_deviation(value: String, deviation: Option<f64>) -> String {
    deviation.map_or(format!("{value} ± –"), |deviation| format!("{value} ± {deviation:.1e}"))
}

fn modes(found: &Found) -> String {
    let has_remarks = found.modes.iter().any(|mode| !(mode.found.doubts.is_empty() && mode.found.warnings.is_empty()));
    let remarks_of = |mode: &IdentifiedMode| {
        let remarks: Vec<&str> = mode.doubts.iter().chain(&mode.warnings).map(|remark| remark.text.as_str()).collect();
        let class = if mode.doubts.is_empty() { "text" } else { "text warn" };
        format!("<td class=\"{class}\">{}</td>", escaped(&remarks.join("; ")))
    };
    let row = |numbered: &NumberedMode| {
        let mode = &numbered.found;
        let mass = mode
            .modal_mass_kg
            .map_or(String::from("–"), |kg| with_deviation(format!("{kg:.5}"), mode.modal_mass_deviation_kg));
        vec![
            name(&numbered.name()),
            cell(&with_deviation(format!("{:.5}", mode.pole_frequency_hz), mode.pole_frequency_deviation_hz)),
            cell(&with_deviation(
                format!("{:.4}", 100.0 * mode.pole_damping_ratio),
                mode.pole_damping_ratio_deviation.map(|deviation| 100.0 * deviation),
            )),
            cell(&mass),
            cell(&mode.collinearity.map_or(String::from("–"), |collinearity| format!("{collinearity:.4}"))),
            if has_remarks { remarks_of(mode) } else { String::new() },
        ]
    };
    let remarks = "remarks";
    let mut head = vec!["mode", "pole frequency (Hz)", "damping ratio (%)", "modal mass (kg)", "collinearity"];
    head.extend(has_remarks.then_some(remarks));
    let caption = "Poles, and modal masses of the shape that is 1 where the force acts";
    format!("<h2>Modes</h2>\n{}", table(caption, &head, &[remarks], found.modes.iter().map(row)))
}

fn levels(levels: &Levels) -> String {
    let title = levels.level.map_or(levels.recordings.join(", "), |level| format!("level {}", short(&level)));
    let verdict = match levels.linear {
        Some(true) => "Linear: no mode shifts by more than four standard deviations (z).",
        Some(false) => "Not linear: a mode shifts by more than four standard deviations (z).",
        None => "No mode was found at both levels.",
    };
    let row = |shift: &super::identify::LevelShift| {
        let [first_hz, _] = shift.pole_frequency_hz;
        vec![
            name(&shift.mode.map_or(format!("{first_hz:.2} Hz"), |number| number.to_string())),
            cell(&format!("{:+.1e}", shift.frequency_shift)),
            cell(&signed(shift.frequency_z, 1)),
            cell(&format!("{:+.1e}", shift.damping_shift)),
            cell(&signed(shift.damping_z, 1)),
        ]
    };
    let head = ["mode", "shift of frequency", "z", "shift of damping", "z"];
    format!(
        "<h2>Against {}</h2>\n<p>{verdict}</p>\n{}",
        escaped(&title),
        table("Shifts, relative, and in their standard deviations", &head, NO_TEXT, levels.modes.iter().map(row))
    )
}

fn shapes(found: &Found) -> String {
    if found.modes.is_empty() {
        return String::new();
    }
    let head: Vec<String> = std::iter::once(String::from("at"))
        .chain(found.modes.iter().map(|mode| format!("mode {}", mode.name())))
        .collect();
    let head: Vec<&str> = head.iter().map(String::as_str).collect();
    let row = |(index, at): (usize, &String)| {
        let part = |mode: &NumberedMode| {
            let IdentifiedMode { shape, shape_per_sqrt_kg, shape_deviation_per_sqrt_kg, .. } = &mode.found;
            let value = shape_per_sqrt_kg.as_ref().unwrap_or(shape)[index];
            let deviation = shape_deviation_per_sqrt_kg.as_ref().and_then(|all| all[index]);
            cell(&value.map_or(String::from("–"), |value| with_deviation(signed(value, 4), deviation)))
        };
        core::iter::once(name(at)).chain(found.modes.iter().map(part)).collect()
    };
    let caption = "Real shapes for the modal mass 1 kg, 1/√kg; without a scale over the largest component";
    format!("<h2>Shapes</h2>\n{}", table(caption, &head, NO_TEXT, found.at.iter().enumerate().map(row)))
}

/// Returns the components of a mode's shape, complex where it has a scale.
fn components(mode: &IdentifiedMode) -> Vec<Option<Complex<f64>>> {
    match &mode.complex_shape_per_sqrt_kg {
        Some(shape) => shape.iter().map(|part| part.map(|[re, im]| Complex::new(re, im))).collect(),
        None => mode.shape.iter().map(|part| part.map(|part| Complex::new(part, 0.0))).collect(),
    }
}

/// Returns the modal assurance criterion of two shapes over the components that both have; not a number without any.
fn criterion(a: &[Option<Complex<f64>>], b: &[Option<Complex<f64>>]) -> f64 {
    let (a, b): (Vec<_>, Vec<_>) = a.iter().zip(b).filter_map(|(a, b)| Some(((*a)?, (*b)?))).unzip();
    modal::assurance(&a, &b)
}

fn own_assurance(found: &Found) -> String {
    if found.modes.is_empty() {
        return String::new();
    }
    let names: Vec<String> = found.modes.iter().map(NumberedMode::name).collect();
    let head: Vec<&str> = std::iter::once("mode").chain(names.iter().map(String::as_str)).collect();
    let all: Vec<_> = found.modes.iter().map(|mode| components(&mode.found)).collect();
    let row = |(index, of): (usize, &String)| {
        let value = |other: &Vec<Option<Complex<f64>>>| {
            let value = criterion(&all[index], other);
            // Without common components it is not a number.
            if value.is_nan() {
                return cell("–");
            }
            // A shade for each fifth; rounding may leave the criterion a little above 1.
            let class = libm::round(5.0 * value.min(1.0)) as u8;
            format!("<td class=\"m{class}\">{value:.3}</td>")
        };
        core::iter::once(name(of)).chain(all.iter().map(value)).collect()
    };
    let caption =
        "MAC of the shapes with each other: far from 0 beside the diagonal, shapes differ too little at these points";
    format!("<h2>Modal assurance criterion</h2>\n{}", table(caption, &head, NO_TEXT, names.iter().enumerate().map(row)))
}

/// Returns a figure with its caption.
fn figure(figure: Figure, caption: &str) -> Result<String, Failure> {
    // The caption below it takes the place of the title.
    let figure = Figure { is_titled: false, ..figure };
    let svg = figure.to_svg()?;
    let caption = escaped(caption);
    Ok(format!("<figure class=\"wide\" tabindex=\"0\">\n{svg}<figcaption>{caption}</figcaption>\n</figure>\n"))
}

/// Draws the responses; of many those at the driving points.
fn responses(document: &Document) -> Result<String, Failure> {
    let all: Vec<(&Run, Curve<'_>)> = document.curves_of_runs();
    let (mut drawn, mut caption): (Vec<&Curve<'_>>, String) =
        (all.iter().map(|(_, curve)| curve).collect(), String::new());
    if drawn.len() > MOST_DRAWN {
        // With several recordings the number of the run follows the degree of freedom in the title.
        let is_driving = |(run, curve): &&(&Run, Curve<'_>)| curve.title.split(',').next() == Some(run.force.as_str());
        let driving = all.iter().filter(is_driving).map(|(_, curve)| curve);
        drawn = driving.take(MOST_DRAWN).collect();
        let shown = drawn.len();
        let count = all.len();
        caption += &format!("{shown} of {count} responses, those where the force acts. identify --plot draws all. ");
    }
    // A driving point may have no accelerometer.
    if drawn.is_empty() {
        drawn = all.iter().map(|(_, curve)| curve).take(MOST_DRAWN).collect();
    }
    let step = |curve: &Curve<'_>| curve.frequency_hz.len().div_ceil(MOST_DOTS).max(1);
    let curves: Vec<Curve<'_>> = drawn.into_iter().map(|curve| Curve { step: step(curve), ..curve.clone() }).collect();
    caption += "Dots are averages of the measured spectra, with leakage at sharp resonances; curves are the fit.";
    if curves.iter().any(|curve| curve.step > 1) {
        caption += " Where the lines are many, some dots are left out.";
    }
    Ok(format!("<h2>Frequency responses</h2>\n{}", figure(responses_figure(&document.found, &curves), &caption)?))
}

fn noise(found: &Found, has_several_runs: bool) -> String {
    if found.noise.is_empty() {
        return String::new();
    }
    let row = |noise: &ReadingNoise| {
        vec![
            name(&noise_name(noise, has_several_runs)),
            cell(&format!("{:.3e}", noise.estimated)),
            cell(&noise.instrument.map_or(String::from("–"), |known| format!("{known:.3e}"))),
        ]
    };
    let caption = "Standard deviation of a sample's noise, as the residuals show it and as the instrument has it";
    let head = ["reading", "estimated", "instrument"];
    format!("<h2>Noise</h2>\n{}", table(caption, &head, NO_TEXT, found.noise.iter().map(row)))
}

fn runs(document: &Document) -> String {
    let mut rows = Vec::new();
    let seed = |seed: Option<u64>| cell(&seed.map_or(String::from("–"), |seed| seed.to_string()));
    let head: Vec<&str>;
    match &document.survey {
        Some(survey) => {
            head = vec![
                "run",
                "recording",
                "level",
                "peak force (N)",
                "force at",
                "accelerometers",
                "length (s)",
                "noise seed",
                "excitation seed",
                "state",
            ];
            for (run, number) in survey.runs.iter().zip(1..) {
                let SurveyRun { file, level, force_n, exciter, sensors, duration_s, .. } = run;
                let state = run.state.name();
                let reason = run.reason.as_ref().map_or(String::new(), |reason| format!(": {reason}"));
                rows.push(vec![
                    name(&i32::to_string(&number)),
                    format!("<td class=\"name\">{}</td>", escaped(&file.display().to_string())),
                    cell(&short(level).to_string()),
                    cell(&force_n.map_or(String::from("–"), |force_n| short(&force_n).to_string())),
                    cell(&exciter.join(", ")),
                    cell(&sensors.len().to_string()),
                    cell(&format!("{duration_s:.3}")),
                    seed(run.seed),
                    seed(run.excitation_seed),
                    format!("<td class=\"name\">{}</td>", escaped(&format!("{state}{reason}"))),
                ]);
            }
        }
        None => {
            head = vec!["run", "recording", "force at", "responses", "length (s)", "samples", "noise seed", "averages"];
            for (run, number) in document.runs.iter().zip(1..) {
                rows.push(vec![
                    name(&i32::to_string(&number)),
                    format!("<td class=\"name\">{}</td>", escaped(&run.recording)),
                    cell(&run.force),
                    cell(&run.responses.len().to_string()),
                    cell(&format!("{:.3}", run.duration_s)),
                    cell(&run.samples.to_string()),
                    seed(run.seed),
                    cell(&run.averages.to_string()),
                ]);
            }
        }
    }
    let caption = "The recordings, with their seeds and lengths";
    let mut text = format!("<h2>Recordings</h2>\n{}", table(caption, &head, &["recording", "state"], rows));
    if let Some(plan) = document.survey.as_ref().and_then(|survey| survey.plan.as_ref()) {
        let excitation = &plan.excitation;
        let seed = plan.seed;
        let from = short(&plan.from_hz);
        let to = short(&plan.to_hz);
        let rate = short(&plan.rate_hz);
        text += &format!("<p>Survey: {excitation}, {from} to {to} Hz, {rate} samples a second, seed {seed}.</p>\n");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A component that one of the shapes lacks does not count.
    #[test]
    fn the_criterion_is_over_common_components() {
        let [one, five] = [1.0, 5.0].map(|part| Some(Complex::new(part, 0.0)));
        assert_eq!(criterion(&[one, None, five], &[one, five, five]), 1.0);
        assert_eq!(criterion(&[one, one, None], &[one, None, one]), 1.0);
        assert!((criterion(&[one, one, None], &[one, Some(Complex::new(0.0, 0.0)), one]) - 0.5).abs() < 1e-15);
        assert!(criterion(&[None], &[one]).is_nan());
    }

    #[test]
    fn markup_is_escaped() {
        assert_eq!(escaped("<script>&\"\u{1b}"), "&lt;script&gt;&amp;&quot;\u{fffd}");
    }
}
