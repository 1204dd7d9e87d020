//! The choices behind the figures: `scenarios/paper/settings.toml`, or a file in its place.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use resonarm_dynamics::structure::Preset;
use resonarm_numeric::number::{rounded, short};
use resonarm_scenario::toml_error::TomlError;

/// All parameters of the figures, stated in the paper or chosen here.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// l2 of both presets, m.
    pub length2_m: f64,
    /// First and last frequency of Figs. 4 and 7, Hz.
    pub range_hz: [f64; 2],
    /// Parameters of Fig. 4.
    pub figure4: Figure4,
    /// Parameters of Fig. 5.
    pub figure5: Figure5,
    /// The line of Fig. 6.
    pub line: Line,
    /// Parameters of Fig. 7.
    pub figure7: Figure7,
    /// Parameters of Fig. 9.
    pub figure9: Figure9,
    /// The force pulse of Section 1.
    pub pulse: Pulse,
    /// The ranges of unstated parameters over which statements are judged.
    pub scan: Scan,
}

/// A value for each preset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PerPreset<T> {
    /// The value for `irb1600-fitted`.
    #[serde(rename = "irb1600-fitted")]
    pub fitted: T,
    /// The value for `irb1600-table1`.
    #[serde(rename = "irb1600-table1")]
    pub table1: T,
}

impl<T> PerPreset<T> {
    /// Returns the value for a preset.
    pub const fn of(&self, preset: Preset) -> &T {
        match preset {
            Preset::Irb1600Fitted => &self.fitted,
            Preset::Irb1600Table1 => &self.table1,
        }
    }
}

/// Fig. 4: amplitude over the frequency of a torque at joint 1.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figure4 {
    /// β2 of the poses, degrees, ascending.
    pub beta2_deg: Vec<f64>,
    /// Amplitude of the torque in panels (a) and (b), N·m.
    pub torque_nm: PerPreset<f64>,
    /// Amplitude of the torque in panel (c), N·m.
    pub second_zone_torque_nm: PerPreset<f64>,
}

/// Fig. 5: amplitude over the amplitude of the torque.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figure5 {
    /// Frequency of the torque, Hz.
    pub frequency_hz: f64,
    /// β2 of the poses, degrees, ascending.
    pub beta2_deg: PerPreset<Vec<f64>>,
    /// The torque at which the curves end, N·m.
    pub largest_torque_nm: PerPreset<f64>,
}

/// The line of Fig. 6, parallel to the x axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Line {
    /// Height of the tip above joint 1, m.
    pub height_m: f64,
}

/// Fig. 7: amplitudes over the frequency of a force at the tip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figure7 {
    /// Poses of panels (a) and (b), degrees, ascending.
    pub beta2_deg: Vec<f64>,
    /// Amplitude of the force in panels (a) and (b), N.
    pub force_n: f64,
    /// Pose of panels (c) and (d), degrees.
    pub detail_beta2_deg: f64,
    /// Amplitudes of the force in panel (c), N, ascending.
    pub second_zone_force_n: PerPreset<Vec<f64>>,
    /// Amplitudes of the force in panel (d), N, ascending.
    pub first_zone_force_n: PerPreset<Vec<f64>>,
}

/// Fig. 9: the measured position.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Figure9 {
    /// β2 of the pose, degrees.
    pub beta2_deg: f64,
    /// First and last frequency, Hz.
    pub range_hz: [f64; 2],
    /// Amplitude of the force, N.
    pub force_n: f64,
}

/// A half-sine pulse of force along x at the tip.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pulse {
    /// Peak of the force, N.
    pub force_n: f64,
    /// The amplitude that the paper states, m.
    pub amplitude_m: f64,
    /// β2 of the pose, degrees.
    pub beta2_deg: f64,
    /// Length of the pulse, s.
    pub length_s: f64,
}

/// Ranges of parameters that the paper does not state.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scan {
    /// Amplitudes of the torque at joint 1, N·m, ascending.
    pub torque_nm: Vec<f64>,
    /// Amplitudes of the force at the tip, N, ascending.
    pub force_n: Vec<f64>,
    /// Heights of the line of Fig. 6, m, ascending.
    pub height_m: Vec<f64>,
    /// Lengths of the pulse of Section 1, s, ascending.
    pub pulse_length_s: Vec<f64>,
    /// Step between the poses of Fig. 5, degrees.
    pub figure5_step_deg: f64,
    /// Largest distance of its frequency from the first natural frequency at these poses, relative to the latter.
    pub figure5_nearness: f64,
    /// More poses for strong excitation, degrees, ascending.
    pub strong_beta2_deg: Vec<f64>,
    /// The torques there, N·m, ascending.
    pub strong_torque_nm: Vec<f64>,
}

/// Error of invalid settings.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SettingsError {
    /// The file can't be read.
    #[error("can't read the settings {}: {source}", path.display())]
    Read {
        /// File that can't be read.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The text is not a settings file.
    #[error(transparent)]
    Parse(#[from] TomlError),
    /// A number is impossible.
    #[error("{key} has {got}: it must be {expected}", got = short(.got))]
    Value {
        /// Key of the number.
        key: String,
        /// Value in the file.
        got: f64,
        /// Description of the valid numbers.
        expected: &'static str,
    },
    /// A list has too few numbers.
    #[error("{key} has {got} values: it must have at least {least}")]
    Count {
        /// Key of the list.
        key: String,
        /// The number of values.
        got: usize,
        /// The least number of values.
        least: usize,
    },
    /// A list or a range is not ascending.
    #[error("{key} has {after} after {before}: its values must ascend", after = short(.after), before = short(.before))]
    Order {
        /// Key of the list.
        key: String,
        /// A value of the list.
        before: f64,
        /// The value that follows it.
        after: f64,
    },
    /// The tip can't reach the line.
    #[error(
        "at β2 = {beta2_deg}° the tip is {reach_m} m from joint 1 and can't be on the line at a height of {height_m} m: bring \
         line.height_m closer to 0, or bend the arm less",
        beta2_deg = short(.beta2_deg), reach_m = rounded(.reach_m, 3), height_m = short(.height_m)
    )]
    Line {
        /// β2 of the pose, degrees.
        beta2_deg: f64,
        /// Distance of the tip from joint 1, m.
        reach_m: f64,
        /// Height of the line, m.
        height_m: f64,
    },
}

impl Settings {
    /// The settings that come with the program, comments included.
    pub const EMBEDDED: &str = include_str!("settings.toml");

    /// The settings that come with the program.
    ///
    /// # Errors
    /// As [`Settings::parse`]; tests ensure that there is none.
    pub fn embedded() -> Result<Settings, SettingsError> {
        Settings::parse(Settings::EMBEDDED, "scenarios/paper/settings.toml")
    }

    /// Reads a settings file: returns its text and the settings.
    ///
    /// # Errors
    /// [`SettingsError::Read`] if the file can't be read; else as [`Settings::parse`].
    pub fn read(path: &Path) -> Result<(String, Settings), SettingsError> {
        let text = resonarm_scenario::text_file::read(path)
            .map_err(|source| SettingsError::Read { path: path.to_path_buf(), source })?;
        let settings = Settings::parse(&text, &path.display().to_string())?;
        Ok((text, settings))
    }

    /// Reads settings from their text; `origin` is its name in messages. Every key is required.
    ///
    /// # Errors
    /// [`SettingsError`] with the key that is unknown, missing or impossible.
    pub fn parse(text: &str, origin: &str) -> Result<Settings, SettingsError> {
        let settings: Settings = toml::from_str(text).map_err(|error| TomlError::new(origin, &error))?;
        settings.check()?;
        Ok(settings)
    }

    fn check(&self) -> Result<(), SettingsError> {
        positive("length2_m", self.length2_m)?;
        ascending("range_hz", &self.range_hz, 2)?;
        poses("figure4.beta2_deg", &self.figure4.beta2_deg)?;
        positive("figure5.frequency_hz", self.figure5.frequency_hz)?;
        finite("line.height_m", self.line.height_m)?;
        poses("figure7.beta2_deg", &self.figure7.beta2_deg)?;
        positive("figure7.force_n", self.figure7.force_n)?;
        poses("figure7.detail_beta2_deg", &[self.figure7.detail_beta2_deg])?;
        poses("figure9.beta2_deg", &[self.figure9.beta2_deg])?;
        ascending("figure9.range_hz", &self.figure9.range_hz, 2)?;
        positive("figure9.force_n", self.figure9.force_n)?;
        positive("pulse.force_n", self.pulse.force_n)?;
        positive("pulse.amplitude_m", self.pulse.amplitude_m)?;
        poses("pulse.beta2_deg", &[self.pulse.beta2_deg])?;
        positive("pulse.length_s", self.pulse.length_s)?;
        self.scan.check()?;
        Preset::ALL.into_iter().try_for_each(|preset| self.check_preset(preset))
    }

    fn check_preset(&self, preset: Preset) -> Result<(), SettingsError> {
        let key = |name: &str| format!("{name}.{preset}");
        let four = &self.figure4;
        let five = &self.figure5;
        let seven = &self.figure7;
        positive(&key("figure4.torque_nm"), *four.torque_nm.of(preset))?;
        positive(&key("figure4.second_zone_torque_nm"), *four.second_zone_torque_nm.of(preset))?;
        poses(&key("figure5.beta2_deg"), five.beta2_deg.of(preset))?;
        positive(&key("figure5.largest_torque_nm"), *five.largest_torque_nm.of(preset))?;
        ascending(&key("figure7.second_zone_force_n"), seven.second_zone_force_n.of(preset), 2)?;
        ascending(&key("figure7.first_zone_force_n"), seven.first_zone_force_n.of(preset), 2)
    }
}

/// The smallest step between the poses of Fig. 5, degrees.
const LEAST_STEP_DEG: f64 = 0.01;

impl Scan {
    fn check(&self) -> Result<(), SettingsError> {
        ascending("scan.torque_nm", &self.torque_nm, 1)?;
        // Statements compare the smallest with the largest force, so there are two at least.
        ascending("scan.force_n", &self.force_n, 2)?;
        // Unlike the other ranges, heights may be zero or negative.
        self.height_m.iter().try_for_each(|height_m| finite("scan.height_m", *height_m))?;
        in_order("scan.height_m", &self.height_m, 1)?;
        ascending("scan.pulse_length_s", &self.pulse_length_s, 1)?;
        let step = self.figure5_step_deg;
        require(
            "scan.figure5_step_deg",
            step,
            (LEAST_STEP_DEG..=180.0).contains(&step),
            "an angle from 0.01 to 180 degrees",
        )?;
        positive("scan.figure5_nearness", self.figure5_nearness)?;
        poses("scan.strong_beta2_deg", &self.strong_beta2_deg)?;
        ascending("scan.strong_torque_nm", &self.strong_torque_nm, 1)
    }
}

fn finite(key: &str, got: f64) -> Result<(), SettingsError> {
    require(key, got, got.is_finite(), "a number")
}

fn positive(key: &str, got: f64) -> Result<(), SettingsError> {
    // Infinity is greater than zero, too, and TOML can state it.
    require(key, got, got.is_finite() && got > 0.0, "a positive number")
}

fn require(key: &str, got: f64, fits: bool, expected: &'static str) -> Result<(), SettingsError> {
    if fits { Ok(()) } else { Err(SettingsError::Value { key: key.to_string(), got, expected }) }
}

/// Checks that there is at least one angle, all from 0 to 180 degrees, ascending.
fn poses(key: &str, angles_deg: &[f64]) -> Result<(), SettingsError> {
    for angle_deg in angles_deg {
        require(key, *angle_deg, (0.0..=180.0).contains(angle_deg), "an angle from 0 to 180 degrees")?;
    }
    in_order(key, angles_deg, 1)
}

/// Checks that there are at least `least` positive numbers, ascending.
fn ascending(key: &str, values: &[f64], least: usize) -> Result<(), SettingsError> {
    values.iter().try_for_each(|value| positive(key, *value))?;
    in_order(key, values, least)
}

fn in_order(key: &str, values: &[f64], least: usize) -> Result<(), SettingsError> {
    if values.len() < least {
        return Err(SettingsError::Count { key: key.to_string(), got: values.len(), least });
    }
    match values.windows(2).find(|pair| pair[0] >= pair[1]) {
        Some(pair) => Err(SettingsError::Order { key: key.to_string(), before: pair[0], after: pair[1] }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_embedded_settings_are_valid() {
        let settings = Settings::embedded().unwrap();
        assert_eq!(settings.figure4.beta2_deg, [0.0, 30.0, 60.0, 90.0, 120.0, 150.0]);
        assert_eq!(toml::from_str::<Settings>(&toml::to_string(&settings).unwrap()).unwrap(), settings);
    }

    fn says(from: &str, to: &str) -> String {
        assert!(Settings::EMBEDDED.contains(from), "{from}");
        Settings::parse(&Settings::EMBEDDED.replacen(from, to, 1), "test.toml").unwrap_err().to_string()
    }

    #[test]
    fn errors_name_the_key_and_the_accepted_values() {
        insta::assert_snapshot!(says("length2_m = 0.6", "length2_m = -0.6"), @"length2_m has -0.6: it must be a positive number");
        insta::assert_snapshot!(says("length2_m = 0.6", "length2_m = -1e300"), @"length2_m has -1e300: it must be a positive number");
        insta::assert_snapshot!(says("[26.0, 46.0]", "[1e300, 1e299]"), @"figure9.range_hz has 1e299 after 1e300: its values must ascend");
        insta::assert_snapshot!(says("height_m = -0.2", "height_m = nan"), @"line.height_m has NaN: it must be a number");
        insta::assert_snapshot!(says("frequency_hz = 22.5", "frequency_hz = 0"), @"figure5.frequency_hz has 0: it must be a positive number");
        insta::assert_snapshot!(says("[0.0, 30.0, ", "[0.0, 300.0, "), @"figure4.beta2_deg has 300: it must be an angle from 0 to 180 degrees");
        insta::assert_snapshot!(says("[26.0, 46.0]", "[46.0, 26.0]"), @"figure9.range_hz has 26 after 46: its values must ascend");
        insta::assert_snapshot!(says("[50.0, 100.0, 200.0, 400.0]", "[50.0]"), @"figure7.second_zone_force_n.irb1600-fitted has 1 values: it must have at least 2");
        insta::assert_snapshot!(says("height_m = -0.2", "heigth_m = -0.25").lines().last().unwrap(), @"Did you mean `height_m`?");
        insta::assert_snapshot!(says("length2_m = 0.6", "").lines().last().unwrap(), @"missing field `length2_m`");
        let absent = Settings::read("/nonexistent/test.toml".as_ref()).unwrap_err();
        insta::assert_snapshot!(absent, @"can't read the settings /nonexistent/test.toml: No such file or directory (os error 2)");
    }
}
