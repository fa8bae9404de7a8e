//! Which axis is meant: by name, by URI, by default, or not at all.

use crate::bench::Bench;
use std::fs;

/// The axis that a status is of.
fn axis(bench: &Bench, words: &str) -> String {
    bench.json(&format!("status {words}"))["axis"].as_str().expect("a name").to_owned()
}

#[test]
fn an_axis_is_named_by_its_name_in_any_case_or_by_where_it_is() {
    let bench = Bench::start();
    let (stage, uhv) = (bench.address(0), bench.address(1));
    assert_eq!(axis(&bench, "-a stage"), "stage");
    assert_eq!(axis(&bench, "--axis STAGE"), "stage");
    assert_eq!(axis(&bench, &format!("-a {stage}")), format!("smsd+tcp://{stage}?unit=1"));
    assert_eq!(
        axis(&bench, &format!("-a smsd+tcp://{stage}?word_order=low-first")),
        format!("smsd+tcp://{stage}?unit=1&word_order=low-first")
    );
    assert_eq!(axis(&bench, &format!("-a smd3+tcp://{uhv}")), format!("smd3+tcp://{uhv}"));
    let port = bench.ready(1)["serial"].as_str().expect("a port").to_owned();
    let port = fs::canonicalize(bench.place().path(&port)).expect("it is there").display().to_string();
    assert_eq!(axis(&bench, &format!("-a {port}")), port);
    assert_eq!(axis(&bench, &format!("-a smd3+serial://{port}")), port);
}

#[test]
fn the_only_axis_needs_no_name() {
    let bench = Bench::start();
    bench.write("one.toml", &format!("[axis.only]\nuri = \"{}\"\n", bench.address(0)));
    assert_eq!(axis(&bench, "--config one.toml"), "only");
    let said = bench.run("status").refused(4);
    assert_eq!(said, "several axes are described in stepdrive.toml: stage, uhv; say which with -a NAME");
}

#[test]
fn the_folder_for_configuration_is_looked_in_after_this_one() {
    let bench = Bench::start();
    fs::remove_file(bench.place().path("stepdrive.toml")).expect("removed");
    let said = bench.run("status").refused(3);
    assert!(
        said.starts_with("no axis is named, and there is no stepdrive.toml here; name an axis"),
        "{said}"
    );
    let said = bench.run("status -a stage").refused(3);
    assert!(
        said.starts_with("there is no axis `stage`: there is no stepdrive.toml here; name an axis"),
        "{said}"
    );
    fs::create_dir_all(bench.place().path("config/stepdrive")).expect("created");
    bench
        .write("config/stepdrive/stepdrive.toml", &format!("[axis.there]\nuri = \"{}\"\n", bench.address(0)));
    assert_eq!(axis(&bench, ""), "there");
}

#[test]
fn an_axis_that_is_not_described_is_exit_code_3_with_those_that_are() {
    let bench = Bench::start();
    let said = bench.run("status -a stag").refused(3);
    let how =
        "name an axis of stepdrive.toml, or where its controller is, as in -a HOST:PORT or -a /dev/ttyACM0";
    assert_eq!(said, format!("there is no axis `stag`: in stepdrive.toml there are stage, uhv; {how}"));
    bench.write("none.toml", "");
    let said = bench.run("status --config none.toml").refused(3);
    assert_eq!(said, format!("none.toml describes no axis; {how}"));
    bench.run("watch nobody").refused(3);
}

#[test]
fn of_many_axes_the_one_that_was_meant_is_suggested() {
    let bench = Bench::start();
    let many = (10..40).map(|number| format!("[axis.linear-{number}]\nuri = \"h:{number}\"\n"));
    bench.write("many.toml", &many.collect::<Vec<String>>().concat());
    let said = bench.run("status --config many.toml -a linaer-17").refused(3);
    assert!(said.contains("in many.toml did you mean linear-17?"), "{said}");
}

#[test]
fn a_name_that_may_be_several_is_exit_code_4() {
    let bench = Bench::start();
    bench.write("two.toml", "[axis.Z]\nuri = \"h:1\"\n[axis.z]\nuri = \"h:2\"\n[axis.zZ]\nuri = \"h:3\"\n[axis.Zz]\nuri = \"h:4\"\n");
    let said = bench.run("status --config two.toml -a ZZ").refused(4);
    assert_eq!(said, "`ZZ` may be any of Zz, zZ; write it as it stands there");
}

#[test]
fn what_is_no_place_is_exit_code_1() {
    let bench = Bench::start();
    for (target, part) in [
        ("ftp://stage", "`ftp` is no kind of target"),
        ("stage:0", "`0` is no TCP port"),
        ("smsd+tcp://me:secret@stage", "a target holds no user and no password"),
        ("smsd+tcp://stage?unit=300", "unit `300` is out of range"),
    ] {
        let said = bench.run(&format!("status -a {target}")).refused(1);
        assert!(said.starts_with(part) && !said.contains("secret"), "{said}");
    }
}

#[test]
fn a_mistake_in_the_file_is_told_with_its_place() {
    let bench = Bench::start();
    bench.write("bad.toml", "[axis.stage]\nuri = \"h:1\"\nunit = \"inch\"\n");
    let ran = bench.run("status --config bad.toml");
    assert_eq!((ran.code(), ran.stdout()), (1, ""));
    let told = "stepdrive: bad.toml:3:8: the unit of an axis is one of mm, deg, turns, steps\n";
    assert!(
        ran.stderr().starts_with(told) && ran.stderr().contains("3 | unit = \"inch\""),
        "{}",
        ran.stderr()
    );
    let said = bench.run("status --config nowhere.toml").refused(1);
    assert!(said.starts_with("cannot read nowhere.toml: "), "{said}");
}

#[test]
fn the_password_comes_from_a_file_or_from_the_environment() {
    let bench = Bench::with("password_file = \"secret\"");
    let said = bench.run("status -a stage").refused(1);
    assert!(said.starts_with("cannot read secret, which is to hold the password of stage: "), "{said}");
    bench.write("secret", "0x0123456789ABCDEF\n");
    bench.run("status -a stage").done();
    bench.write("secret", "hunter2");
    let said = bench.run("status -a stage").refused(1);
    assert!(
        said.starts_with("what secret holds is no password of stage") && !said.contains("hunter2"),
        "{said}"
    );
    let said = bench.run("status -a stage --password-env STAGE_PASSWORD").refused(1);
    assert_eq!(said, "the variable STAGE_PASSWORD, which is to hold the password of stage, is not set");
    let mut command = bench.command("status -a stage --password-env STAGE_PASSWORD");
    assert!(command.env("STAGE_PASSWORD", "123456789abcdef").status().expect("started").success());
}

#[test]
fn a_wrong_password_is_exit_code_6() {
    let bench = Bench::with("password_file = \"secret\"");
    bench.write("secret", "1\n");
    let said = bench.run("get -a stage MAX_SPEED").refused(6);
    assert!(
        said.contains("does not accept the password, in either word order; nothing else was sent"),
        "{said}"
    );
}
