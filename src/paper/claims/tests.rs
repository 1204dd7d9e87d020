use super::*;

#[test]
fn verdicts_and_numbers_stay_what_they_are() {
    let settings = Settings::embedded().unwrap();
    let report = judge(&settings, || ()).unwrap();
    assert!(report.is_complete());
    insta::assert_snapshot!(report.text(), @r"
    pulse (Section 1)
      A force pulse of 100 N makes the robot vibrate with an amplitude of 0.1 mm.
        irb1600-table1  does not hold  0.248 mm after 5 ms; 0.1 mm after 1.73 ms
        irb1600-fitted  holds          0.141 mm after 5 ms; 0.1 mm after 3.48 ms
    natural-frequencies-depend-on-pose (Section 3)
      The natural frequencies depend strongly on the pose.
        irb1600-table1  holds          f1 21.77 to 28.86 Hz, f2 79.99 to 569.25 Hz
        irb1600-fitted  holds          f1 20.43 to 28.77 Hz, f2 40.21 to 59.15 Hz
    natural-frequencies-symmetric (Section 3)
      The natural frequencies are symmetric about the straight arm, β2 = 0.
        irb1600-table1  holds          largest difference 0e0
        irb1600-fitted  holds          largest difference 0e0
    zones-draw-together (Section 4, Fig. 4a)
      The resonance zones of the nonlinear arm draw together as |β2| grows.
        irb1600-table1  does not hold  546.25, 158.05, 78.10, 55.63, 59.05, 111.24 Hz apart
        irb1600-fitted  holds          38.13, 34.45, 26.98, 18.93, 14.17, 12.34 Hz apart
    zones-within-the-range (Section 4, Fig. 4a)
      Both resonance zones lie between 0 and 80 Hz.
        irb1600-table1  does not hold  0 of 6 poses; f2 569.3, 180.3, 101.5, 81.1, 86.5, 139.8 Hz
        irb1600-fitted  holds          6 of 6 poses; f2 59.1, 55.7, 48.9, 43.2, 40.4, 40.9 Hz
    first-zone-stiff-when-straight (Section 4, Fig. 4b)
      For small β2 the first zone is stiff (hardening).
        irb1600-table1  does not hold  0° stiff (+0.054 Hz), 30° soft (-0.020 Hz)
        irb1600-fitted  holds          0° stiff (+0.294 Hz), 30° stiff (+0.148 Hz)
    first-zone-mixed-when-bent (Section 4, Fig. 4b)
      For large β2 the first zone is mixed, softening and hardening.
        irb1600-table1  does not hold  90° soft (-0.352 Hz), 120° soft (-0.281 Hz), 150° soft (-0.061 Hz)
        irb1600-fitted  holds          90° soft, then stiff (+0.044 Hz), 120° soft (-0.757 Hz), 150° stiff, then soft (+0.108 Hz)
    second-zone-soft-when-straight (Section 4, Fig. 4c)
      For small β2 the second zone is soft (softening).
        irb1600-table1  holds          0° soft (-1.575 Hz), 30° soft (-0.017 Hz)
        irb1600-fitted  holds          0° soft (-0.462 Hz), 30° soft (-0.295 Hz)
    second-zone-stiff-when-bent (Section 4, Fig. 4c)
      As β2 grows the second zone moves to lower frequencies and becomes stiff.
        irb1600-table1  holds          90° stiff (+0.015 Hz), 120° stiff (+0.076 Hz), 150° stiff (+0.105 Hz)
        irb1600-fitted  does not hold  90° stiff (+0.106 Hz), 120° stiff (+0.010 Hz), 150° soft (-0.005 Hz)
    elbow-up-is-elbow-down (Section 4)
      The characteristics are the same for β2 and −β2.
        irb1600-table1  holds          20 peaks and folds, differences below 1e-9
        irb1600-fitted  holds          26 peaks and folds, differences below 1e-9
    amplitude-sets-the-branch (Section 4, Fig. 5)
      At one frequency the arm has several motions depending on the forcing amplitude, with bifurcations that depend on the pose.
        irb1600-table1  does not hold  30° none; 38° none; 39° none; 40° none
        irb1600-fitted  does not hold  60° none; 67° at 333.8, 47.0 N·m; 68° none; 70° none
    branches-differ-sixfold (Section 6)
      In the zones the amplitude differs up to six times with the direction of the sweep.
        irb1600-table1  holds          zone 1: 12.5, 4.6, 50.6, 70.3, 35.8, 9.9; zone 2: 1.0, 1.0, 1.0, 1.0, 1.0, 1.0 times
        irb1600-fitted  holds          zone 1: 41.5, 38.2, 70.6, 6.0, 123.9, 23.0; zone 2: 5.8, 4.4, 1.0, 1.5, 1.0, 1.0 times
    link-1-in-the-first-zone (Section 4, Fig. 7a)
      Under a force at the tip link 1 moves far more in the first zone than in the second.
        irb1600-table1  holds          60° 36.98, 90° 65.00, 120° 26.04, 150° 25.01 times
        irb1600-fitted  holds          60° 3.74, 90° 2.43, 120° 14.79, 150° 18.34 times
    link-2-in-the-second-zone (Section 4, Fig. 7b)
      Link 2 moves more in the second zone than in the first.
        irb1600-table1  does not hold  60° 0.68, 90° 1.64, 120° 0.79, 150° 0.29 times
        irb1600-fitted  holds          60° 1.73, 90° 4.30, 120° 3.79, 150° 1.18 times
    second-zone-leans-more (Section 4, Fig. 7a,b)
      The slope of the characteristics shows more clearly in the second zone.
        irb1600-table1  does not hold  60° 11.1 and 0.2, 90° 25.1 and 1.1, 120° 30.0 and 1.6, 150° 6.1 and 0.1 widths
        irb1600-fitted  does not hold  60° 2.6 and 0.2, 90° 0.9 and 1.4, 120° 8.4 and 3.3, 150° 4.3 and 0.1 widths
    second-zone-widens (Section 4, Fig. 7c)
      The second zone of link 1 widens with the force at β2 = 150°.
        irb1600-table1  does not hold  0.7992, 0.7935, 0.7847, 0.7728 Hz under 50, 100, 200, 400 N
        irb1600-fitted  does not hold  0.0714, 0.0709, 0.0707, 0.0728 Hz under 50, 100, 200, 400 N
    second-maximum (Section 4, Fig. 7d)
      With the force a second maximum of link 2 appears in the first zone at β2 = 150°, and the zone widens.
        irb1600-table1  does not hold  1, 1, 1, 1 maxima, width 0.0113, 0.0267, 0.0291, 0.0225 Hz under 50, 100, 150, 200 N
        irb1600-fitted  holds          1, 1, 1, 2 maxima, width 0.0096, 0.0210, 0.0416, 0.3666 Hz under 100, 200, 400, 600 N
    both-zones-measured (Section 5, Fig. 9)
      At β2 = 120° both zones lie between 26 and 46 Hz.
        irb1600-table1  does not hold  27.49 and 87.02 Hz
        irb1600-fitted  holds          26.78 and 40.60 Hz
    soft-then-stiff-measured (Section 5, Fig. 9)
      At β2 = 120° the first zone is soft and the second stiff, and link 2 hardly moves in the first.
        irb1600-table1  does not hold  soft (-0.281 Hz), stiff (+0.709 Hz); link 2 1.27 times
        irb1600-fitted  holds          soft (-0.072 Hz), stiff (+0.234 Hz); link 2 0.26 times
    period-doubling (Section 6)
      At larger excitation there are saddle-nodes and period doublings.
        irb1600-table1  does not hold  4 saddle-nodes; period doublings: none
        irb1600-fitted  holds          8 saddle-nodes; period doublings: 22.302, 22.268, 22.344, 22.358, 22.293, 22.330 Hz
    neimark-sacker (Section 6)
      At larger excitation there is a Neimark–Sacker bifurcation.
        irb1600-table1  holds          24.283, 24.357 Hz
        irb1600-fitted  holds          22.870, 22.963, 22.980 Hz
    irb1600-table1: 8 of 21 hold
    irb1600-fitted: 17 of 21 hold
    ");
}
