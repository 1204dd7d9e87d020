use super::*;

#[test]
fn verdicts_and_numbers_stay_what_they_are() {
    let settings = Settings::embedded().unwrap();
    let report = judge(&settings, || ()).unwrap();
    assert!(report.is_complete());
    insta::assert_snapshot!(report.text(), @"");
}
