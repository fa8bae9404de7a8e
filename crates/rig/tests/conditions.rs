//! Conditions: what holds when, how they are written, and what a person is told about mistakes.
#![allow(clippy::needless_pass_by_value, reason = "an `Expect` is written in place")]

use expect_test::{Expect, expect};
use proptest::prelude::*;
use stepdrive_rig::condition::Condition;
use stepdrive_rig::file::RigFile;
use stepdrive_rig::names::AnyQuantity;

/// Two SMSDs, `stage` and `x-1`, an SMD3 named `uhv`, and one with the name of a word.
fn rig() -> RigFile {
    let drives = "drive = [\n\
        { name = \"stage\", model = \"SMSD-4.2LAN\", modbus_tcp = \"127.0.0.1:0\" },\n\
        { name = \"x-1\", model = \"SMSD-4.2LAN\", modbus_tcp = \"127.0.0.1:0\" },\n\
        { name = \"uhv\", model = \"SMD3\", serial = \"pty\" },\n\
        { name = \"not\", model = \"SMD3\", serial = \"pty\" },\n]\n";
    RigFile::parse(drives).unwrap_or_else(|error| panic!("{}", error.render("rig.toml")))
}

fn condition(text: &str) -> Condition {
    Condition::parse(text, &rig()).unwrap_or_else(|error| panic!("{}", error.render(text)))
}

/// Whether a condition holds with every quantity at its value.
fn holds(text: &str, values: &[(&str, f64)]) -> bool {
    let rig = rig();
    condition(text).holds(&mut |drive, quantity| {
        let name = format!("{}.{quantity}", rig.drives[drive].name);
        let found = values.iter().find(|(known, _)| *known == name);
        found.unwrap_or_else(|| panic!("{name} was asked for")).1
    })
}

/// What a person reads about the first mistake in a condition.
fn check(text: &str, expect: Expect) {
    let error = Condition::parse(text, &rig()).expect_err(text);
    expect.assert_eq(&error.render(text));
}

/// That a condition is written so.
fn check_form(text: &str, form: &str) {
    assert_eq!(condition(text).to_string(), form);
    assert_eq!(condition(form), condition(text));
}

#[test]
fn a_quantity_is_true_when_it_is_not_0() {
    for (value, expected) in [(0.0, false), (-0.0, false), (1.0, true), (-3.0, true), (0.001, true)] {
        assert_eq!(holds("stage.READY", &[("stage.READY", value)]), expected);
        assert_eq!(holds("!stage.READY", &[("stage.READY", value)]), !expected);
    }
}

#[test]
fn a_quantity_is_compared_with_a_number() {
    for (text, below, equal, above) in [
        ("stage.ABS_POS > 5000", false, false, true),
        ("stage.ABS_POS >= 5000", false, true, true),
        ("stage.ABS_POS < 5000", true, false, false),
        ("stage.ABS_POS <= 5000", true, true, false),
        ("stage.ABS_POS == 5000", false, true, false),
        ("stage.ABS_POS = 5000", false, true, false),
        ("stage.ABS_POS != 5000", true, false, true),
    ] {
        for (value, expected) in [(4_999.0, below), (5_000.0, equal), (5_001.0, above)] {
            assert_eq!(holds(text, &[("stage.ABS_POS", value)]), expected, "{text} at {value}");
        }
    }
}

#[test]
fn numbers_are_decimal_or_hexadecimal_or_true_or_false() {
    for (text, number) in [
        ("5", 5.0),
        ("-5", -5.0),
        ("0.25", 0.25),
        ("-0.25", -0.25),
        ("0x1F", 31.0),
        ("-0X1f", -31.0),
        ("0x20000000000000", 9_007_199_254_740_992.0),
        ("true", 1.0),
        ("FALSE", 0.0),
    ] {
        assert!(holds(&format!("uhv.TMOT=={text}"), &[("uhv.TMOT", number)]), "{text}");
        assert!(!holds(&format!("uhv.TMOT=={text}"), &[("uhv.TMOT", number + 2.0)]), "{text}");
    }
}

#[test]
fn not_binds_before_and_and_and_before_or() {
    check_form("!stage.HiZ && stage.STOP || uhv.BAKE", "!stage.HiZ && stage.STOP || uhv.BAKE");
    check_form("!(stage.HiZ && stage.STOP) || uhv.BAKE", "!(stage.HiZ && stage.STOP) || uhv.BAKE");
    check_form("!stage.HiZ && (stage.STOP || uhv.BAKE)", "!stage.HiZ && (stage.STOP || uhv.BAKE)");
    check_form("(!stage.HiZ && stage.STOP) || (uhv.BAKE)", "!stage.HiZ && stage.STOP || uhv.BAKE");
    let values = |one, two, three| [("stage.HiZ", one), ("stage.STOP", two), ("uhv.BAKE", three)];
    assert!(holds("stage.HiZ or stage.STOP and uhv.BAKE", &values(1.0, 0.0, 0.0)));
    assert!(!holds("(stage.HiZ or stage.STOP) and uhv.BAKE", &values(1.0, 0.0, 0.0)));
}

#[test]
fn words_stand_for_signs_in_any_case_and_spaces_do_not_matter() {
    check_form("not stage.HiZ AND stage.STOP Or uhv.BAKE", "!stage.HiZ && stage.STOP || uhv.BAKE");
    check_form("not(stage.HiZ)and(stage.STOP)", "!stage.HiZ && stage.STOP");
    check_form("\n\t! stage.HiZ&&stage.SPEED>5||uhv.BAKE  ", "!stage.HiZ && stage.SPEED > 5 || uhv.BAKE");
}

#[test]
fn names_are_written_as_the_rig_has_them() {
    check_form("STAGE.ready", "stage.READY");
    check_form("X-1.Speed=0x10", "x-1.SPEED == 16");
    check_form("uhv.motor_short", "uhv.MOTOR_SHORT");
    check_form("stage.Carriage < -0.5 && !stage.STALLED", "stage.carriage < -0.5 && !stage.stalled");
    check_form("not not.powered", "!not.powered");
    check_form("not.powered", "not.powered");
    check_form("uhv.limit_negative || uhv.Limit-Negative", "uhv.LIMIT_NEGATIVE || uhv.LIMIT-NEGATIVE");
    check_form("uhv.l+>5&&uhv.L->=-5", "uhv.L+ > 5 && uhv.L- >= -5");
}

#[test]
fn parentheses_and_double_negations_that_change_nothing_go() {
    check_form("((stage.READY))", "stage.READY");
    check_form("!!stage.READY", "stage.READY");
    check_form("!(!(stage.SPEED > 5))", "stage.SPEED > 5");
    check_form("not not not stage.READY", "!stage.READY");
    check_form("!(stage.SPEED > 5)", "!(stage.SPEED > 5)");
    check_form(
        "stage.READY && (stage.STOP && stage.HiZ) && (stage.ACC || (stage.DEC || uhv.BAKE))",
        "stage.READY && stage.STOP && stage.HiZ && (stage.ACC || stage.DEC || uhv.BAKE)",
    );
}

#[test]
fn no_more_is_looked_at_than_it_takes() {
    assert!(!holds("stage.READY && stage.STOP", &[("stage.READY", 0.0)]));
    assert!(holds("stage.READY || stage.STOP", &[("stage.READY", 1.0)]));
}

#[test]
fn it_knows_its_drives_and_whether_they_flow() {
    let drives = |text: &str| condition(text).drives().collect::<Vec<_>>();
    assert_eq!(drives("uhv.BAKE || x-1.READY && uhv.TMOT > 5"), [1, 2]);
    assert_eq!(drives("!(stage.READY)"), [0]);
    for text in ["stage.READY", "uhv.BAKE || stage.IN0", "stage.powered"] {
        assert!(!condition(text).flows(), "{text}");
    }
    for text in ["stage.ABS_POS", "uhv.BAKE || !(uhv.TMOT > 5)", "stage.carriage = 5", "stage.stalled"] {
        assert!(condition(text).flows(), "{text}");
    }
}

#[test]
fn every_quantity_of_a_drive_can_be_spoken_of() {
    let rig = rig();
    for drive in &rig.drives {
        for quantity in drive.quantities() {
            let text = format!("{}.{quantity}", drive.name);
            let mut asked: Option<AnyQuantity> = None;
            condition(&text).holds(&mut |_, quantity| {
                asked = Some(quantity);
                0.0
            });
            assert_eq!((asked, condition(&text).to_string()), (Some(quantity), text));
        }
    }
}

#[test]
fn unknown_names_are_shown_with_those_that_there_are() {
    check(
        "stage.READY && stag.READY",
        expect![[r#"
        column 16: unknown drive `stag`; there are stage, x-1, uhv, not
          |
          | stage.READY && stag.READY
          |                ^^^^"#]],
    );
    check(
        "stage.READY && stage.ABSPOS >= 5",
        expect![[r#"
        column 22: unknown quantity `ABSPOS` of `stage`; did you mean ABS_POS?
          |
          | stage.READY && stage.ABSPOS >= 5
          |                      ^^^^^^"#]],
    );
    check(
        "uhv.LIMIT_POSTIVE",
        expect![[r#"
        column 5: unknown quantity `LIMIT_POSTIVE` of `uhv`; did you mean LIMIT_POSITIVE?
          |
          | uhv.LIMIT_POSTIVE
          |     ^^^^^^^^^^^^^"#]],
    );
    check(
        "uhv.colour",
        expect![[r#"
            column 5: unknown quantity `colour` of `uhv`; there are IDENT, MODE, JSMODE, AUTOJS, EXTEN, TSEL, TMOT, IR, IA, IH, PDDEL, IHD, F, RES, L, L+, L-, LP+, LP-, LSM, AMAX, DMAX, VSTART, VSTOP, VMAX, VACT, PACT, PREL, TZW, THIGH, EDGE, INTERP, BAKET, JSCON, LIMIT-NEGATIVE, LIMIT-POSITIVE, STANDBY, BAKE, ATSPEED, TSHORT and 20 more
              |
              | uhv.colour
              |     ^^^^^^"#]],
    );
}

#[test]
fn what_is_missing_is_told_where_it_is_missing() {
    check("", expect!["column 1: expected a quantity of a drive, as in stage.READY"]);
    check(
        "stage",
        expect![[r#"
        column 1: expected a quantity of a drive, as in stage.READY
          |
          | stage
          | ^^^^^"#]],
    );
    check(
        "stage.",
        expect![[r#"
        column 1: expected a quantity of a drive, as in stage.READY
          |
          | stage.
          | ^^^^^"#]],
    );
    check(
        "stage.READY &&",
        expect![[r#"
        column 15: expected a quantity of a drive, as in stage.READY
          |
          | stage.READY &&
          |               ^"#]],
    );
    check(
        "stage.SPEED >",
        expect![[r#"
        column 14: expected a number, as in stage.SPEED >= 100
          |
          | stage.SPEED >
          |              ^"#]],
    );
}

#[test]
fn parts_are_joined_and_parentheses_come_in_pairs() {
    check(
        "(stage.READY || uhv.BAKE",
        expect![[r#"
        column 1: there is no ) for this (
          |
          | (stage.READY || uhv.BAKE
          | ^"#]],
    );
    check(
        "stage.READY uhv.BAKE",
        expect![[r#"
        column 13: expected && or || or the end of the condition
          |
          | stage.READY uhv.BAKE
          |             ^"#]],
    );
    check(
        "stage.READY)",
        expect![[r#"
        column 12: there is no ( for this )
          |
          | stage.READY)
          |            ^"#]],
    );
    check(
        "(stage.READY uhv.BAKE)",
        expect![[r#"
        column 14: expected && or || or )
          |
          | (stage.READY uhv.BAKE)
          |              ^"#]],
    );
    check(
        "()",
        expect![[r#"
        column 2: expected a quantity of a drive, as in stage.READY
          |
          | ()
          |  ^"#]],
    );
}

#[test]
fn what_does_not_belong_there_is_told() {
    check(
        "stage.READY & uhv.BAKE",
        expect![[r#"
        column 13: expected && or || or the end of the condition
          |
          | stage.READY & uhv.BAKE
          |             ^"#]],
    );
    check(
        "5 < stage.SPEED",
        expect![[r#"
        column 1: expected a quantity of a drive, as in stage.READY
          |
          | 5 < stage.SPEED
          | ^"#]],
    );
    check(
        "1 < stage.SPEED < 5",
        expect![[r#"
        column 1: expected a quantity of a drive, as in stage.READY
          |
          | 1 < stage.SPEED < 5
          | ^"#]],
    );
    check(
        "größe.READY",
        expect![[r#"
        column 1: expected a quantity of a drive, as in stage.READY
          |
          | größe.READY
          | ^^"#]],
    );
    check(
        "true",
        expect![[r#"
        column 1: expected a quantity of a drive, as in stage.READY
          |
          | true
          | ^^^^"#]],
    );
}

#[test]
fn a_quantity_is_compared_with_one_number_and_nothing_else() {
    check(
        "stage.SPEED > 1 > 0",
        expect![[r#"
        column 17: expected && or || or the end of the condition
          |
          | stage.SPEED > 1 > 0
          |                 ^"#]],
    );
    check(
        "stage.SPEED > uhv.TMOT",
        expect![[r#"
        column 15: `uhv.TMOT` is no number, as in stage.SPEED >= 100
          |
          | stage.SPEED > uhv.TMOT
          |               ^^^^^^^^"#]],
    );
    check(
        "stage.SPEED > 1e3",
        expect![[r#"
        column 15: `1e3` is no number, as in stage.SPEED >= 100
          |
          | stage.SPEED > 1e3
          |               ^^^"#]],
    );
    check(
        "stage.SPEED => 5",
        expect![[r#"
        column 14: expected a number, as in stage.SPEED >= 100
          |
          | stage.SPEED => 5
          |              ^"#]],
    );
}

#[test]
fn not_before_a_comparison_is_refused() {
    check(
        "stage.READY && !stage.SPEED > 5",
        expect![[r#"
        column 16: is this for the quantity or the comparison? For the latter, write !(stage.SPEED > 5)
          |
          | stage.READY && !stage.SPEED > 5
          |                ^"#]],
    );
    check(
        "not stage.SPEED == 0",
        expect![[r#"
        column 1: is this for the quantity or the comparison? For the latter, write !(stage.SPEED == 0)
          |
          | not stage.SPEED == 0
          | ^"#]],
    );
    check(
        "!!stage.SPEED == 0",
        expect![[r#"
        column 1: is this for the quantity or the comparison? For the latter, write !(stage.SPEED == 0)
          |
          | !!stage.SPEED == 0
          | ^"#]],
    );
}

#[test]
fn columns_count_characters_and_what_is_no_text_is_not_shown() {
    check(
        "stage.READY\t\u{1b}[31m&& ä",
        expect![[r#"
        column 13: expected && or || or the end of the condition
          |
          | stage.READY  [31m&& ä
          |             ^"#]],
    );
}

#[test]
fn numbers_that_are_none_are_refused() {
    for text in [
        "", "-", "--5", "5-3", ".5", "5.", "1.2.3", "0x", "0xG", "0x-1", "1_000", "inf", "NaN", "+5", "-true",
    ] {
        let error = Condition::parse(&format!("stage.SPEED > {text}"), &rig()).expect_err(text);
        assert_eq!(error.column, 15, "{text}: {error}");
    }
    let endless = format!("stage.SPEED > {}", "9".repeat(400));
    assert!(Condition::parse(&endless, &rig()).is_err());
    assert!(Condition::parse("stage.SPEED > 0x20000000000001", &rig()).is_err());
}

#[test]
fn length_and_nesting_have_an_end() {
    let nested = |depth: usize| "(".repeat(depth) + "stage.READY" + &")".repeat(depth);
    assert_eq!(condition(&nested(32)), condition("stage.READY"));
    check(
        &nested(33),
        expect![[r#"
        column 33: more than 32 parentheses within each other
          |
          | (((((((((((((((((((((((((((((((((stage.READY)))))))))))))))))))))))))))))))))
          |                                 ^"#]],
    );
    assert_eq!(condition(&("!".repeat(900) + "stage.READY")), condition("stage.READY"));
    let padded = |length: usize| "stage.READY".to_owned() + &" ".repeat(length - 11);
    assert_eq!(condition(&padded(1_000)), condition("stage.READY"));
    check(&padded(1_001), expect!["column 1001: a condition has at most 1000 characters"]);
    let dense = vec!["uhv.BAKE"; 99].join("||");
    check(&dense, expect!["column 1: a condition has at most 1000 characters, written out with spaces"]);
}

/// A condition made up for a test, and the slow way to see whether it holds.
#[derive(Clone, Debug)]
enum Made {
    Set(usize),
    Compared(usize, &'static str, i32),
    Not(Box<Made>),
    Both(Box<Made>, Box<Made>),
    Either(Box<Made>, Box<Made>),
}

const QUANTITIES: [&str; 5] = ["stage.READY", "x-1.ABS_POS", "uhv.MOTOR_SHORT", "not.TMOT", "stage.carriage"];

impl Made {
    /// The condition as text, with parentheses round everything.
    fn text(&self, words: bool) -> String {
        let [not, and, or] = if words { ["not ", " and ", " or "] } else { ["!", "&&", "||"] };
        match self {
            Made::Set(quantity) => QUANTITIES[*quantity].to_owned(),
            Made::Compared(quantity, sign, number) => format!("{}{sign}{number}", QUANTITIES[*quantity]),
            Made::Not(part) => format!("{not}({})", part.text(words)),
            Made::Both(one, other) => format!("({}){and}({})", one.text(words), other.text(words)),
            Made::Either(one, other) => format!("({}){or}({})", one.text(words), other.text(words)),
        }
    }

    fn holds(&self, values: &[i32]) -> bool {
        match self {
            Made::Set(quantity) => values[*quantity] != 0,
            Made::Compared(quantity, sign, number) => {
                let order = values[*quantity].cmp(number);
                match *sign {
                    ">" => order.is_gt(),
                    ">=" => order.is_ge(),
                    "<" => order.is_lt(),
                    "<=" => order.is_le(),
                    "!=" => order.is_ne(),
                    _ => order.is_eq(),
                }
            }
            Made::Not(part) => !part.holds(values),
            Made::Both(one, other) => one.holds(values) && other.holds(values),
            Made::Either(one, other) => one.holds(values) || other.holds(values),
        }
    }
}

fn made() -> impl Strategy<Value = Made> {
    let quantity = 0..QUANTITIES.len();
    let sign = prop::sample::select(vec![">", ">=", "<", "<=", "==", "=", "!="]);
    let leaf = prop_oneof![
        quantity.clone().prop_map(Made::Set),
        (quantity, sign, -2..3).prop_map(|(quantity, sign, number)| Made::Compared(quantity, sign, number)),
    ];
    leaf.prop_recursive(5, 24, 2, |inner| {
        prop_oneof![
            inner.clone().prop_map(|part| Made::Not(part.into())),
            (inner.clone(), inner.clone()).prop_map(|(one, other)| Made::Both(one.into(), other.into())),
            (inner.clone(), inner).prop_map(|(one, other)| Made::Either(one.into(), other.into())),
        ]
    })
}

proptest! {
    #[test]
    fn it_holds_when_the_slow_way_says_so_and_is_read_back_from_its_normal_form(
        made in made(),
        words: bool,
        values in prop::array::uniform5(-2..3),
    ) {
        let condition = condition(&made.text(words));
        let rig = rig();
        let holds = condition.holds(&mut |drive, quantity| {
            let name = format!("{}.{quantity}", rig.drives[drive].name);
            f64::from(values[QUANTITIES.iter().position(|known| *known == name).expect("one of them")])
        });
        prop_assert_eq!(holds, made.holds(&values));
        let form = condition.to_string();
        prop_assert_eq!(Condition::parse(&form, &rig), Ok(condition), "{}", form);
    }

    #[test]
    fn no_text_panics(text: String) {
        if let Err(error) = Condition::parse(&text, &rig()) {
            let _ = error.render(&text);
        }
    }

    #[test]
    fn no_row_of_parts_panics_and_what_is_read_has_a_normal_form(
        parts in prop::collection::vec(
            prop::sample::select(vec![
                "stage.READY", "uhv.TMOT", "x-1.", ".", "stage", "not", "and", "or", "!", "&&", "||", "(", ")", ">",
                "<=", "=", "!=", "-", "5", "0x1F", "1.5", "true", " ", "\n", "ä", "\u{0}",
            ]),
            0..12,
        ),
        space: bool,
    ) {
        let text = parts.join(if space { " " } else { "" });
        match Condition::parse(&text, &rig()) {
            Ok(condition) => prop_assert_eq!(Condition::parse(&condition.to_string(), &rig()), Ok(condition)),
            Err(error) => {
                prop_assert!((1..=text.chars().count() + 1).contains(&error.column), "{error}");
                let _ = error.render(&text);
            }
        }
    }
}
