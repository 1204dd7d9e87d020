//! Whole figures. With `RESONARM_PLOT_DIR` set, they are written there for inspection.

use super::*;

const CYCLE: [Color; 5] = [Color::Blue, Color::Vermillion, Color::Green, Color::Orange, Color::Purple];

/// A resonance with a gap in it, amplitude over phase, and measured points.
fn response() -> Figure {
    let h = |f: f64| {
        let r = f / 20.43;
        let (re, im) = (1.0 - r * r, 0.02 * r);
        (libm::hypot(re, im).recip() * 1e-4, -libm::atan2(im, re).to_degrees())
    };
    let frequencies = || {
        (0..=1600).map(|k| 15.0 + f64::from(k) / 100.0).map(|f| if (27.0..27.4).contains(&f) { f64::NAN } else { f })
    };
    let amplitude = frequencies().map(|f| (f, h(f).0)).collect();
    let phase = frequencies().map(|f| (f, h(f).1)).collect();
    let measured: Vec<(f64, f64)> = [16.0, 19.0, 20.43, 22.0, 26.0].map(|f| (f, 1.01 * h(f).0)).to_vec();
    let measured_phase = measured.iter().map(|(f, _)| (*f, h(*f).1)).collect();
    let x = || Axis::linear("frequency f (Hz)");
    Figure::new("Response of joint 1 to a stepped sine")
        .subtitle("preset irb1600-fitted, β₂ = 0°, torque 60 N·m at joint 1")
        .with(
            Panel::new(x(), Axis::log("amplitude |α₁| (rad)"))
                .with(Series::line("linear theory, D as in Table 1", Color::Blue, amplitude))
                .with(Series::markers("measured", Color::Vermillion, Marker::Circle, measured)),
        )
        .with(
            Panel::new(x(), Axis::degrees("phase of α₁ (°)").range(-190.0, 10.0))
                .with(Series::line("linear theory, D as in Table 1", Color::Blue, phase).unlabelled())
                .with(Series::markers("measured", Color::Vermillion, Marker::Circle, measured_phase).unlabelled()),
        )
}

/// A Duffing resonance of the kind that continuation gives: stable, unstable, folds. a² from the amplitude equation
/// ((1 − Ω²+ ¾ κ a²)² + (2 ζ Ω)²) a² = p², solved for Ω² (A. H. Nayfeh, D. T. Mook, "Nonlinear Oscillations", 1979).
fn continuation() -> Figure {
    let (zeta, p): (f64, f64) = (0.01, 0.02);
    let branch = |sign: f64| {
        let amplitudes = (1..=4000).map(move |k| f64::from(k) / 4000.0);
        amplitudes.filter_map(move |a| {
            let b = 1.0 + 0.75 * 0.3 * a * a - 2.0 * zeta * zeta;
            let root = b * b - ((1.0 + 0.75 * 0.3 * a * a).powi(2) - p * p / (a * a));
            (root >= 0.0).then(|| ((b + sign * root.sqrt()).sqrt() * 20.43, a))
        })
    };
    let lower: Vec<_> = branch(1.0).collect();
    let fold = lower.iter().enumerate().min_by(|a, b| a.1.0.total_cmp(&b.1.0)).map_or(0, |(index, _)| index);
    let line = |label: &str, color, dash, points: &[(f64, f64)]| {
        Series::line(label, color, points.to_vec()).style(Style::Line { color, width: 1.8, dash })
    };
    let x = Axis::linear("excitation frequency f (Hz)").range(19.0, 23.0);
    let y = Axis::linear("amplitude of α₁ (rad)").range(0.0, 1.1);
    Figure::new("Hardening resonance").with(
        Panel::new(x, y)
            .with(line("stable", Color::Stable, Dash::Solid, &branch(-1.0).collect::<Vec<_>>()))
            .with(line("stable", Color::Stable, Dash::Solid, &lower[..=fold]))
            .with(line("unstable", Color::Unstable, Dash::Dashed, &lower[fold..]))
            .with(Series::markers("fold", Color::Black, Marker::Diamond, vec![lower[fold]])),
    )
}

/// Six small panels in two columns, each marker and dash, factors, tight ranges, a noisy record.
fn grid() -> Figure {
    let marks = [Marker::Circle, Marker::Square, Marker::Triangle, Marker::Diamond, Marker::Cross];
    let dashes = [Dash::Solid, Dash::Dashed, Dash::Chain];
    let x = || Axis::linear("time t (s)");
    let ramp = |slope: f64| (0..=10).map(|k| (f64::from(k), slope * f64::from(k))).collect::<Vec<_>>();
    let mut markers = Panel::new(x(), Axis::linear("acceleration of point C along x (m/s²)")).title("β₂ = 0°");
    for (index, shape) in marks.into_iter().enumerate() {
        let style = Style::Markers { color: CYCLE[index], shape, size: 7.0, filled: index % 2 == 0 };
        markers = markers
            .with(Series::line(format!("{shape:?}"), Color::Black, ramp(1e-7 * (index + 1) as f64)).style(style));
    }
    let mut lines = Panel::new(x(), Axis::linear("force F (N)")).title("β₂ = 30°");
    for (index, dash) in dashes.into_iter().enumerate() {
        let style = Style::Line { color: CYCLE[index], width: 1.6, dash };
        lines =
            lines.with(Series::line(format!("{dash:?}"), Color::Black, ramp(2e5 * (index + 1) as f64)).style(style));
    }
    let noise = (0..200_000_u64).map(|k| {
        let random = (k.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407) >> 33) as f64;
        (k as f64 / 20_000.0, random / f64::from(1_u32 << 31) - 0.5)
    });
    let full = Panel::new(x(), Axis::linear("noise (V)")).title("β₂ = 60°").with(Series::line(
        "ADC",
        Color::Green,
        noise.collect(),
    ));
    let tight = Panel::new(Axis::linear("f (Hz)"), Axis::log("|H| (rad/(N·m))")).title("β₂ = 90°");
    let tight = tight.with(Series::line(
        "H",
        Color::Purple,
        (1..=50).map(|k| (46.0698 + f64::from(k) * 3.2e-5, libm::exp10(f64::from(k) / 4.0 - 9.0))).collect(),
    ));
    let figure = Figure {
        columns: 2,
        ..Figure::new(
            "A title so long that it takes two lines: six poses of the arm, with every style of line and marker that there is",
        )
    };
    figure.with(markers).with(lines).with(full).with(tight)
}

fn every_figure() -> [(&'static str, Figure); 3] {
    [("response", response()), ("continuation", continuation()), ("grid", grid())]
}

#[test]
fn figures_are_written_as_svg_and_png_and_are_reproducible() {
    let folder = tempfile::tempdir().unwrap();
    let folder = std::env::var_os("RESONARM_PLOT_DIR").map_or(folder.path().to_owned(), PathBuf::from);
    for (name, figure) in every_figure() {
        let [svg, png, caption] = figure.write(&folder.join(format!("{name}.v1"))).unwrap();
        assert!(svg.ends_with(format!("{name}.v1.svg")) && png.ends_with(format!("{name}.v1.png")));
        assert_eq!(std::fs::read_to_string(&svg).unwrap(), figure.to_svg().unwrap());
        assert_eq!(std::fs::read(&png).unwrap(), figure.to_png().unwrap());
        assert!(caption.ends_with(format!("{name}.v1.txt")));
        assert_eq!(std::fs::read_to_string(&caption).unwrap(), figure.caption());
    }
}

/// The subtitle's line has as many parts as fit; the caption has all.
#[test]
fn a_long_subtitle_is_cut_to_a_line_and_whole_in_the_caption() {
    let parts: Vec<String> = (1..=20).map(|k| format!("part {k}")).collect();
    let mut subtitle = Subtitle::from(parts.join(", "));
    subtitle.more = vec![String::from("and more")];
    let figure = response().subtitle(subtitle.clone());
    let svg = figure.to_svg().unwrap();
    assert_eq!(svg.matches(">part 1, ").count(), 1);
    assert!(svg.contains(", …<") && !svg.contains("part 20"), "{svg}");
    assert_eq!(figure.caption(), format!("{}\n{}\nand more\n", figure.title, parts.join(", ")));
    let short = response().subtitle(Subtitle::from("a part").and("").and("another"));
    assert!(short.to_svg().unwrap().contains(">a part, another<"));
}

/// The value of an attribute in the text of an element.
fn attribute<'a>(element: &'a str, name: &str) -> Option<&'a str> {
    element.split_once(&format!(" {name}=\"")).and_then(|(_, rest)| rest.split_once('"')).map(|(value, _)| value)
}

#[test]
fn stacked_panels_share_one_x_axis() {
    let svg = response().to_svg().unwrap();
    assert_eq!(svg.matches(">frequency f (Hz)<").count(), 1);
    let frames: Vec<&str> =
        svg.lines().filter(|line| line.contains("#202020")).map(|line| attribute(line, "d").unwrap()).collect();
    let left = |frame: &str| frame.split_once(' ').unwrap().0.to_owned();
    assert_eq!(frames.len(), 2);
    assert_eq!(left(frames[0]), left(frames[1]), "the plots don't line up");
    let apart = Figure { columns: 2, ..response() };
    assert_eq!(apart.to_svg().unwrap().matches(">frequency f (Hz)<").count(), 2);
}

#[test]
fn a_gap_breaks_the_line_and_a_long_one_stays_compact() {
    let svg = response().to_svg().unwrap();
    let theory = svg.lines().find(|line| line.contains("#0072B2")).unwrap();
    assert_eq!(theory.matches('M').count(), 2);
    let noise = grid().to_svg().unwrap();
    assert!(noise.len() < 120_000, "{} bytes for 200000 points", noise.len());
}

#[test]
fn the_png_is_at_300_dpi_and_shows_the_data() {
    let bytes = continuation().to_png().unwrap();
    let decoder = ::png::Decoder::new(std::io::Cursor::new(bytes));
    let mut reader = decoder.read_info().unwrap();
    let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut pixels).unwrap();
    assert_eq!(info.width, 2250); // 7.5 inch
    assert_eq!(reader.info().pixel_dims.unwrap().xppu, 11_811);
    let count = |color: Color| pixels.chunks(3).filter(|pixel| **pixel == color.rgb()).count();
    assert!(count(Color::Stable) > 5_000 && count(Color::Unstable) > 1_000, "the branches aren't there");
    assert!(count(Color::Green) == 0);
}

/// Sixty responses of a survey, one below the other, are longer than an image may be.
#[test]
fn a_long_figure_has_fewer_dots_per_inch() {
    let long = Figure { panels: vec![continuation().panels[0].clone(); 60], ..continuation() };
    let bytes = long.to_png().unwrap();
    let decoder = ::png::Decoder::new(std::io::Cursor::new(bytes));
    let reader = decoder.read_info().unwrap();
    let info = reader.info();
    assert_eq!(info.height, 20_000);
    let dpi = f64::from(info.pixel_dims.unwrap().xppu) * 0.0254;
    assert!((f64::from(info.width) - 7.5 * dpi).abs() < 1.0, "{} pixels, {dpi} dpi", info.width);
}

#[test]
fn the_legend_covers_no_data_or_goes_below() {
    let line = |points: Vec<(f64, f64)>| Series::line("data", Color::Blue, points);
    let panel = || Panel::new(Axis::linear("x"), Axis::linear("y"));
    let label = |panel: Panel, axis: &str| {
        let svg = Figure::new("").with(panel).to_svg().unwrap();
        let label = svg.lines().find(|line| line.contains(">data<")).map(str::to_owned);
        label.map(|label| attribute(&label, axis).unwrap().parse::<f64>().unwrap())
    };
    let label_x = |panel: Panel| label(panel, "x");
    // Rising data leave the upper left free, falling ones the upper right; data everywhere leave no corner.
    assert!(label_x(panel().with(line(vec![(0.0, 0.0), (1.0, 1.0)]))).unwrap() < 200.0);
    let right = label_x(panel().with(line(vec![(0.0, 1.0), (1.0, 0.0)]))).unwrap();
    assert!((500.0..700.0).contains(&right));
    let zigzag = (0..200).map(|k| (f64::from(k), f64::from(k % 2))).collect::<Vec<_>>();
    let below = label(panel().with(line(zigzag.clone())), "y").unwrap();
    assert!(below > 430.0, "the plot is 380 px high");
    assert_eq!(label(panel().with(line(vec![(0.0, 1.0), (1.0, 0.0)])).legend(Legend::Below), "y").unwrap(), below);
    assert_eq!(label_x(panel().with(line(zigzag)).legend(Legend::None)), None);
}

/// A legend beside one of two panels made the other wider: it is below both, and they are equally wide.
#[test]
fn panels_side_by_side_are_equally_wide_whatever_their_legends() {
    let zigzag = (0..200).map(|k| (f64::from(k), f64::from(k % 2))).collect::<Vec<_>>();
    let panel = || {
        let panel = Panel::new(Axis::linear("x"), Axis::linear("y"));
        panel.with(Series::line("a rather long name of the data", Color::Blue, zigzag.clone()))
    };
    for legend in [Legend::Auto, Legend::Below, Legend::Bottom] {
        let figure =
            Figure { columns: 2, ..Figure::new("").with(panel().legend(legend)).with(panel().legend(Legend::None)) };
        let scene = layout::scene(&figure).unwrap();
        let frames = scene.shapes.iter().filter_map(|shape| match shape {
            scene::Shape::Lines { runs, stroke } if stroke.color == [0x20; 3] => Some(runs[0][1][0] - runs[0][0][0]),
            _ => None,
        });
        let widths: Vec<f64> = frames.collect();
        assert!(widths.len() == 2 && (widths[0] - widths[1]).abs() < 1e-9, "{legend:?}: {widths:?}");
    }
}

#[test]
fn tiles_leave_no_gap() {
    let points = (0..5).flat_map(|x| (0..4).map(move |y| (f64::from(x), f64::from(y)))).collect();
    let panel = Panel::new(Axis::linear("x"), Axis::linear("y"));
    let figure = Figure::new("").with(panel.with(Series::tiles("cells", Color::SkyBlue, [1.0, 1.0], points)));
    let scene = layout::scene(&figure).unwrap();
    let mut rows: Vec<_> = scene
        .shapes
        .iter()
        .filter_map(|shape| match shape {
            scene::Shape::Rect { area, fill } if *fill == Color::SkyBlue.rgb() && area.right - area.left > 20.0 => {
                Some(*area)
            }
            _ => None,
        })
        .collect();
    rows.sort_by(|a, b| a.top.total_cmp(&b.top));
    assert_eq!(rows.len(), 4);
    assert!(rows.windows(2).all(|pair| pair[0].bottom > pair[1].top), "rows overlap");
}

#[test]
fn an_axis_of_names_has_as_many_as_fit() {
    let svg = |count: usize| {
        let names = (1..=count).map(|number| format!("mode {number}")).collect();
        let tiles = Series::tiles("cells", Color::SkyBlue, [1.0, 1.0], vec![(1.0, 0.0), (2.0, 1.0)]);
        Figure::new("").with(Panel::new(Axis::names("x", names), Axis::linear("y")).with(tiles)).to_svg().unwrap()
    };
    let has = |svg: &str, number: usize| svg.contains(&format!(">mode {number}</text>"));
    let few = svg(3);
    assert!((1..=3).all(|number| has(&few, number)), "{few}");
    let many = svg(40);
    let shown: Vec<usize> = (1..=40).filter(|number| has(&many, *number)).collect();
    assert!(shown.len() >= 5 && shown[1] > 2, "{shown:?}");
    assert!(shown.windows(2).all(|pair| pair[1] - pair[0] == shown[1] - 1), "{shown:?}");
}

#[test]
fn a_figure_without_title_keeps_it_in_the_caption() {
    let figure = Figure { is_titled: false, ..response() };
    let svg = figure.to_svg().unwrap();
    assert!(!svg.contains("preset irb1600-fitted") && figure.caption().contains("preset irb1600-fitted"));
}

fn refused(panel: Panel) -> String {
    Figure::new("Test").with(panel).to_svg().unwrap_err().to_string()
}

#[test]
fn figures_that_cannot_be_drawn_are_refused() {
    let line = |points: &[(f64, f64)]| Series::line("s", Color::Blue, points.to_vec());
    let linear = || Panel::new(Axis::linear("f (Hz)"), Axis::linear("a (rad)"));
    insta::assert_snapshot!(Figure::new("Test").to_svg().unwrap_err(), @"the figure `Test` has 0 panels in 1 columns; it needs at least one of each");
    let without_columns = Figure { columns: 0, ..response() };
    insta::assert_snapshot!(without_columns.to_png().unwrap_err(), @"the figure `Response of joint 1 to a stepped sine` has 2 panels in 0 columns; it needs at least one of each");
    insta::assert_snapshot!(refused(linear().with(line(&[]))), @"panel 0 of the figure `Test` has no point to draw");
    insta::assert_snapshot!(refused(linear().with(line(&[(1.0, f64::NAN)]))), @"panel 0 of the figure `Test` has no point to draw");
    insta::assert_snapshot!(refused(linear().with(line(&[(1.0, 1.0), (2.0, f64::INFINITY)]))), @"point 1 of series 0 in panel 0 is at (2, inf); coordinates must be finite, or NaN for a gap");
    let log = Panel::new(Axis::linear("f (Hz)"), Axis::log("a (rad)"));
    insta::assert_snapshot!(refused(log.with(line(&[(1.0, 1.0), (2.0, 0.0)]))), @"point 1 of series 0 in panel 0 is at 0 on the logarithmic axis `a (rad)`; values must be positive there: leave the point out, put NaN for a gap, or use a linear axis");
    let range = |low, high| {
        refused(Panel::new(Axis::linear("f (Hz)").range(low, high), Axis::linear("a")).with(line(&[(1.0, 1.0)])))
    };
    insta::assert_snapshot!(range(3.0, 2.0), @"the axis `f (Hz)` can't go from 3 to 2; both must be finite, ascending, and positive on a logarithmic axis");
    insta::assert_snapshot!(range(0.0, f64::NAN), @"the axis `f (Hz)` can't go from 0 to NaN; both must be finite, ascending, and positive on a logarithmic axis");
    let log = Panel::new(Axis::log("f (Hz)").range(0.0, 2.0), Axis::linear("a"));
    insta::assert_snapshot!(refused(log.with(line(&[(1.0, 1.0)]))), @"the axis `f (Hz)` can't go from 0 to 2; both must be finite, ascending, and positive on a logarithmic axis");
    insta::assert_snapshot!(refused(linear().with(line(&[(-1e308, 1.0), (1e308, 1.0)]))), @"the axis `f (Hz)` can't go from NaN to NaN; both must be finite, ascending, and positive on a logarithmic axis");
    let error = response().write("/nonexistent/figure".as_ref()).unwrap_err();
    insta::assert_snapshot!(error, @"can't write /nonexistent/figure.svg: No such file or directory (os error 2); check that the folder exists and that you may write there");
    let huge = Figure { panels: vec![linear().with(line(&[(1.0, 1.0)])); 2000], ..continuation() };
    let error = huge.to_png().unwrap_err().to_string();
    assert!(error.starts_with("an image of 540 x "), "{error}");
    assert!(error.ends_with(" pixels can't be drawn; give the figure fewer panels, or write it as SVG"), "{error}");
}

#[test]
fn equal_data_get_a_range_around_them() {
    for points in [vec![(1.0, 0.0)], vec![(5.0, 5.0), (5.0, 5.0)], vec![(0.0, -3.0)]] {
        let panel = Panel::new(Axis::linear("x"), Axis::linear("y"));
        let svg = Figure::new("")
            .with(panel.with(Series::markers("m", Color::Black, Marker::Square, points)))
            .to_svg()
            .unwrap();
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }
}

#[test]
fn notes_outside_of_the_axes_are_not_drawn() {
    let panel = Panel::new(Axis::linear("x").range(0.0, 1.0), Axis::linear("y"));
    let line = Series::line("l", Color::Blue, vec![(0.0, 0.0), (1.0, 1.0)]);
    let note = |x, text: &str| Note { at: (x, 0.5), text: text.to_owned() };
    let notes = vec![note(0.5, "inside"), note(2.0, "outside")];
    let svg = Figure::new("").with(Panel { notes, ..panel.with(line) }).to_svg();
    let svg = svg.unwrap();
    assert!(svg.contains(">inside<") && !svg.contains("outside"));
}
