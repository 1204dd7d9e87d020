//! The statements. Each rule follows from the paper's words, independent of the result; for words such as "strongly" or
//! "significantly" the rule states its threshold. The functions quote the paper.

use super::{Statement, bending, linear, pulse, tip, torque};
use resonarm_analysis::BifurcationKind;

/// A statement, in the order: name, section, statement, rule, whether I_S2 was chosen for it, function.
macro_rules! statement {
    ($id:literal, $section:literal, $statement:literal, $rule:literal, $chosen_for:literal, $judge:expr) => {
        Statement {
            id: $id,
            section: $section,
            statement: $statement,
            rule: $rule,
            chosen_for: $chosen_for,
            judge: $judge,
        }
    };
}

pub(super) const STATEMENTS: [Statement; 30] = [
    statement!(
        "pulse",
        "1",
        "A force pulse of 100 N makes the robot vibrate with an amplitude of 0.1 mm.",
        "largest displacement of C after a half-sine pulse rounds to 0.1 mm: from 0.05 to 0.15 mm",
        false,
        pulse::amplitude
    ),
    statement!(
        "natural-frequencies-depend-on-pose",
        "3",
        "The natural frequencies depend strongly on the pose.",
        "f1 and f2 each vary by more than a tenth for β2 from −180° to 180°",
        false,
        linear::depend_on_pose
    ),
    statement!(
        "natural-frequencies-symmetric",
        "3",
        "The natural frequencies are symmetric about the straight arm, β2 = 0.",
        "relative difference between β2 and −β2 below 1e-12",
        false,
        linear::symmetric
    ),
    statement!(
        "natural-frequencies-draw-together",
        "3, 4",
        "The natural frequencies draw together as |β2| grows.",
        "f2 − f1 falls from each pose of Fig. 4 to the next",
        true,
        linear::draw_together
    ),
    statement!(
        "zones-within-the-range",
        "4, Fig. 4a",
        "Both resonance zones lie between 0 and 80 Hz.",
        "f2 below 80 Hz at all poses of Fig. 4",
        true,
        linear::within_the_range
    ),
    statement!(
        "zones-draw-together",
        "4, Fig. 4a",
        "The resonance zones of the nonlinear arm draw together as |β2| grows.",
        "distance of the two peaks of link 1 falls from each pose of Fig. 4 to the next",
        true,
        torque::zones_draw_together
    ),
    statement!(
        "direction-matters",
        "4, 6, Fig. 4",
        "In the resonance zones the amplitude depends on the direction of the sweep.",
        "in each zone, at one pose of Fig. 4 at least, two stable periodic responses share a frequency, with folds between them",
        false,
        torque::direction_matters
    ),
    statement!(
        "first-zone-stiff-when-straight",
        "4, Fig. 4b",
        "For small β2 the first zone is stiff (hardening).",
        "backbone of mode 1 up to the torque hardens at 0° and 30°",
        true,
        bending::first_stiff_when_straight
    ),
    statement!(
        "first-zone-mixed-when-bent",
        "4, Fig. 4b",
        "For large β2 the first zone is mixed, softening and hardening.",
        "backbone of mode 1 up to the torque turns, in either order, at 120° and 150°",
        true,
        bending::first_mixed_when_bent
    ),
    statement!(
        "second-zone-soft-when-straight",
        "4, Fig. 4c",
        "For small β2 the second zone is soft (softening).",
        "backbone of mode 2 up to the torque softens at 0° and 30°",
        true,
        bending::second_soft_when_straight
    ),
    statement!(
        "second-zone-shifts-down",
        "4, Fig. 4c",
        "As β2 grows the second zone moves to lower frequencies.",
        "peak of link 1 in zone 2 falls from each pose of Fig. 4 to the next",
        false,
        torque::second_zone_shifts_down
    ),
    statement!(
        "second-zone-stiff-when-bent",
        "4, Fig. 4c",
        "As β2 grows the second zone becomes stiff.",
        "backbone of mode 2 up to the torque hardens at 120° and 150°",
        true,
        bending::second_stiff_when_bent
    ),
    statement!(
        "characters-change",
        "6",
        "With the pose the zones change from stiff to soft or back.",
        "each zone is stiff at one pose of Fig. 4 at least and soft at another",
        true,
        bending::characters_change
    ),
    statement!(
        "elbow-up-is-elbow-down",
        "4",
        "The characteristics are the same for β2 and −β2.",
        "peaks and folds of both zones agree to 1e-9",
        false,
        torque::symmetric
    ),
    statement!(
        "links-alike",
        "4",
        "The characteristics of link 2 are qualitatively those of link 1.",
        "in each zone of Fig. 4 equally many maxima of 5 % prominence",
        false,
        torque::links_alike
    ),
    statement!(
        "amplitude-sets-the-branch",
        "4, 6, Fig. 5",
        "At 22.5 Hz the arm has several periodic responses depending on the forcing amplitude, with bifurcations that depend on the pose.",
        "two poses near resonance at least have folds, at different torques",
        false,
        torque::folds_over_the_torque
    ),
    statement!(
        "branches-differ-sixfold",
        "6",
        "The amplitudes differ by up to six times with the direction of the sweep.",
        "largest ratio of stable amplitudes of link 1 at one frequency in Fig. 4 rounds to 6",
        false,
        torque::largest_ratio
    ),
    statement!(
        "link-1-in-the-first-zone",
        "4, Fig. 7a",
        "Under a force at the tip link 1 moves significantly more in the first zone than in the second.",
        "peak of link 1 in zone 1 at least twice that in zone 2, at each position",
        false,
        tip::link1_in_the_first_zone
    ),
    statement!(
        "link-2-in-the-second-zone",
        "4, Fig. 7b",
        "The opposite is true for link 2.",
        "peak of link 2 in zone 2 at least twice that in zone 1, at each position",
        false,
        tip::link2_in_the_second_zone
    ),
    statement!(
        "second-zone-leans-more",
        "4, Fig. 7a,b",
        "The slope of the characteristics shows more clearly in the second zone.",
        "backbone of zone 2 moves by more Hz than that of zone 1 up to the force, at each position",
        false,
        tip::second_zone_leans_more
    ),
    statement!(
        "second-zone-widens",
        "4, Fig. 7c",
        "The second zone of link 1 widens with the force at β2 = 150°.",
        "half-power width about the peak grows from each force to the next",
        false,
        tip::second_zone_widens
    ),
    statement!(
        "second-maximum",
        "4, Fig. 7d",
        "With the force a second maximum of link 2 appears in the first zone at β2 = 150°.",
        "one maximum of 5 % prominence under the smallest force, two or more under the largest",
        false,
        tip::second_maximum
    ),
    statement!(
        "first-zone-widens",
        "4, Fig. 7d",
        "The first zone of link 2 widens with the force at β2 = 150°.",
        "half-power width about the peak grows from each force to the next",
        false,
        tip::first_zone_widens
    ),
    statement!(
        "both-zones-measured",
        "5, Fig. 9",
        "At β2 = 120° both zones lie between 26 and 46 Hz.",
        "peaks of link 1 in zone 1 and of link 2 in zone 2 are inside",
        true,
        tip::both_zones_measured
    ),
    statement!(
        "soft-then-stiff-measured",
        "5, Fig. 9",
        "At β2 = 120° the first zone is soft and the second stiff.",
        "backbones up to the force soften and harden",
        true,
        tip::soft_then_stiff
    ),
    statement!(
        "link-2-small-in-the-first-zone",
        "5, Fig. 9b",
        "At β2 = 120° link 2 hardly moves in the first zone.",
        "peak of link 2 in zone 1 at most half of that in zone 2",
        false,
        tip::link2_small_in_the_first_zone
    ),
    statement!(
        "zones-widen",
        "6",
        "The resonance zones are wider at larger excitation.",
        "half-power width of link 1 grows from each torque to the next",
        false,
        torque::zones_widen
    ),
    statement!(
        "saddle-nodes",
        "6",
        "At larger excitation there are saddle-nodes.",
        "found in one zone at least under the torques or forces of the scan",
        false,
        |survey| torque::observed(survey, BifurcationKind::Fold)
    ),
    statement!(
        "period-doubling",
        "6",
        "At larger excitation there is period doubling.",
        "found in one zone at least under the torques or forces of the scan",
        false,
        |survey| torque::observed(survey, BifurcationKind::PeriodDoubling)
    ),
    statement!(
        "neimark-sacker",
        "6",
        "At larger excitation there is a Neimark–Sacker bifurcation.",
        "found in one zone at least under the torques or forces of the scan",
        false,
        |survey| torque::observed(survey, BifurcationKind::NeimarkSacker)
    ),
];
