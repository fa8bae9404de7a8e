//! A linear stage on an SMSD: home it, go to a position, come back a turn.
//!
//! `stepdrive up` in one terminal, and in another:
//! `cargo run -p stepdrive-host --example smsd_move -- smsd+tcp://127.0.0.1:5020`

use stepdrive_host::axis::{AxisOptions, MoveOptions, SoftLimits, open};
use stepdrive_host::units::{Amount, Decimal, Goal, Scale};
use stepdrive_host::uri::Target;
use stepdrive_host::{Direction, Error};

#[tokio::main(flavor = "current_thread")]
async fn main() -> Result<(), Error> {
    let target = std::env::args().nth(1).unwrap_or_else(|| "smsd+tcp://127.0.0.1:5020".to_owned());
    run(&target).await
}

/// Homes the stage and moves it.
pub(crate) async fn run(target: &str) -> Result<(), Error> {
    // A screw of 5 mm on a motor of 200 full steps, which may go from 0 to 45 mm.
    let options = AxisOptions {
        scale: Scale::millimetres(Decimal::whole(5), 200)?,
        limits: SoftLimits::new(Decimal::ZERO, Decimal::whole(45))?,
        ..AxisOptions::default()
    };
    let stage = open(&Target::parse(target)?, &options);

    // Nothing is known of its position yet, so `to` a position would be refused.
    let before = stage.state().await?;
    println!("{} is at {}, {}", stage.name(), before.position, before.trust);

    stage.home(Direction::Negative, MoveOptions::default()).await?;
    println!("home");

    // What a move would be, before it is made.
    let goal = Goal::parse("to 12.5mm")?;
    let plan = stage.plan(goal, MoveOptions::default()).await?;
    println!("{goal}: {} in {:.2} s", plan.distance, plan.duration.as_secs_f64());
    stage.go(goal, MoveOptions::default()).await?;
    stage.move_by(Amount::parse("-1 turn")?, MoveOptions::default()).await?;

    let after = stage.state().await?;
    println!("{} is at {}, {}", stage.name(), after.position, after.trust);
    Ok(())
}
