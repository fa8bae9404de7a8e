//! A rig in step with its clock, shared by all who are connected to it.

use crate::clock::Clock;
use crate::recording::{Entry, Recorder};
use crate::traffic::Tap;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use stepdrive_rig::action::Action;
use stepdrive_rig::any::AnyMachine;
use stepdrive_rig::file::RigFile;
use stepdrive_rig::group::Group;
use stepdrive_spec::time::Instant;

/// The most that may happen in a group while a client waits: some milliseconds of computing. When more is due, rig time
/// is held back.
pub(crate) const SLICE: u32 = 50_000;

/// A rig that is running.
pub(crate) struct World {
    rig: RigFile,
    clock: Clock,
    cells: Vec<Cell>,
    /// For each drive the number of its cell, and which member of the group it is.
    places: Vec<(usize, usize)>,
    recorder: OnceLock<Recorder>,
    tap: Arc<Tap>,
    /// How many connections there have been.
    connections: AtomicU64,
    /// A scenario that is being played: then all groups go forward together.
    play: Mutex<Option<Box<dyn Play>>>,
    playing: AtomicBool,
}

/// Whoever brings all groups of a rig forward together, because what happens in one has to do with what is done to
/// another: a scenario.
pub(crate) trait Play: Send {
    /// Brings all groups to `to` or as far as `budget` allows, which is counted down, and does at the right instants what
    /// is to be done. What is done to a group goes by [`World::apply_to`], so that it is recorded.
    fn advance(&mut self, world: &World, groups: &mut [&mut Group], to: Instant, budget: &mut u32);

    /// What it is called.
    fn name(&self) -> String;
}

/// A group, and the bell for whoever keeps its time.
struct Cell {
    group: Mutex<Group>,
    /// Rung when the group wants to be woken at another time than before.
    wake_changed: tokio::sync::Notify,
    /// When whoever keeps its time is going to wake it, in nanoseconds; `u64::MAX` when it is not.
    expected: AtomicU64,
}

impl World {
    /// A rig whose machines, in the order of the file, have just been switched on.
    pub(crate) fn new(rig: RigFile, machines: Vec<AnyMachine>) -> World {
        let groups = build(&rig, machines);
        let places = places(&rig, &groups);
        let cell = |group| Cell {
            group: Mutex::new(group),
            wake_changed: tokio::sync::Notify::new(),
            expected: AtomicU64::new(u64::MAX),
        };
        World {
            clock: Clock::start(rig.clock),
            rig,
            cells: groups.into_iter().map(cell).collect(),
            places,
            recorder: OnceLock::new(),
            tap: Arc::default(),
            connections: AtomicU64::new(0),
            play: Mutex::new(None),
            playing: AtomicBool::new(false),
        }
    }

    /// Writes everything that goes in from now on to a recording.
    pub(crate) fn record(&self, recorder: Recorder) {
        // It is called once, before anybody is served.
        let _ = self.recorder.set(recorder);
    }

    /// The rig file.
    pub(crate) fn rig(&self) -> &RigFile {
        &self.rig
    }

    /// The clock.
    pub(crate) fn clock(&self) -> &Clock {
        &self.clock
    }

    /// The recording that is being made.
    pub(crate) fn recorder(&self) -> Option<&Recorder> {
        self.recorder.get()
    }

    /// Where what clients and drives say can be overheard.
    pub(crate) fn tap(&self) -> &Arc<Tap> {
        &self.tap
    }

    /// Whether the bytes of what clients say are wanted as they came.
    pub(crate) fn keeps_bytes(&self) -> bool {
        self.recorder().is_some() || self.tap.is_watched()
    }

    /// How many groups there are.
    pub(crate) fn groups(&self) -> usize {
        self.cells.len()
    }

    /// The number of a drive's group.
    pub(crate) fn group_of(&self, drive: usize) -> usize {
        self.places.get(drive).map_or(0, |(group, _)| *group)
    }

    /// The number of a new connection: the first is 1.
    pub(crate) fn new_connection(&self) -> u64 {
        self.connections.fetch_add(1, Ordering::Relaxed) + 1
    }

    /// Does something with a drive's group, alone and at the present time; `act` is given the group and which member the
    /// drive is.
    pub(crate) fn visit<R>(&self, drive: usize, act: impl FnOnce(&mut Group, usize) -> R) -> R {
        let (cell, member) = self.places.get(drive).copied().unwrap_or_default();
        self.visit_group(cell, |group| act(group, member))
    }

    /// Does something with a group, alone and at the present time.
    pub(crate) fn visit_group<R>(&self, number: usize, act: impl FnOnce(&mut Group) -> R) -> R {
        #[allow(
            clippy::indexing_slicing,
            reason = "callers pass the number of a group, of which there is at least one"
        )]
        let cell = &self.cells[number];
        let mut group = cell.lock();
        // Asked with the group locked: once something is being played, no group goes its own way.
        if self.playing.load(Ordering::Acquire) {
            drop(group);
            return self.visit_all(|groups| act(groups.get_mut(number).expect("one for each cell")));
        }
        self.bring_up(&mut group);
        let outcome = act(&mut group);
        cell.expect(&group);
        outcome
    }

    /// Does something with all groups, alone and at the present time.
    pub(crate) fn visit_all<R>(&self, act: impl FnOnce(&mut [&mut Group]) -> R) -> R {
        let mut play = self.lock_play();
        self.with_all(|groups| {
            match play.as_mut() {
                Some(play) => self.go_on_playing(play.as_mut(), groups),
                None => groups.iter_mut().for_each(|group| self.bring_up(group)),
            }
            act(groups)
        })
    }

    /// Does something with all groups, alone and at the present time, if no scenario is being played.
    pub(crate) fn visit_unplayed<R>(&self, act: impl FnOnce(&mut [&mut Group]) -> R) -> Option<R> {
        let play = self.lock_play();
        play.is_none().then(|| {
            self.with_all(|groups| {
                for group in groups.iter_mut() {
                    self.bring_up(group);
                }
                act(groups)
            })
        })
    }

    /// Begins to play; `false` when something is being played already.
    pub(crate) fn begin_play(&self, new: Box<dyn Play>) -> bool {
        let mut play = self.lock_play();
        if play.is_some() {
            return false;
        }
        *play = Some(new);
        self.playing.store(true, Ordering::Release);
        true
    }

    /// What is being played.
    pub(crate) fn playing(&self) -> Option<String> {
        self.lock_play().as_ref().map(|play| play.name())
    }

    /// Ends playing.
    pub(crate) fn end_play(&self) {
        self.playing.store(false, Ordering::Release);
        *self.lock_play() = None;
    }

    fn go_on_playing(&self, play: &mut dyn Play, groups: &mut [&mut Group]) {
        let now = self.clock.now();
        play.advance(self, groups, now, &mut SLICE.clone());
        for group in groups.iter_mut() {
            settle(group);
        }
        let reached = groups.iter().map(|group| group.now()).min().unwrap_or(now);
        if reached < now {
            self.clock.hold_back(reached);
        }
    }

    fn with_all<R>(&self, act: impl FnOnce(&mut [&mut Group]) -> R) -> R {
        let mut guards: Vec<MutexGuard<'_, Group>> = self.cells.iter().map(Cell::lock).collect();
        let mut groups: Vec<&mut Group> = guards.iter_mut().map(|guard| &mut **guard).collect();
        let outcome = act(&mut groups);
        self.cells.iter().zip(&groups).for_each(|(cell, group)| cell.expect(group));
        outcome
    }

    /// Carries out an action at the present time.
    pub(crate) fn apply(&self, action: &Action) {
        let drive = action.drive(&self.rig).unwrap_or(0);
        self.visit(drive, |group, _| self.apply_to(group, action));
    }

    /// Carries out an action on the group that it is for, which has been brought up to its time. What follows from an
    /// action before it at the same instant happens first.
    pub(crate) fn apply_to(&self, group: &mut Group, action: &Action) {
        settle(group);
        group.apply(action);
        self.write(|| Entry::action(group.now(), action.text(&self.rig)));
        self.look_after(action.drive(&self.rig).unwrap_or(0));
    }

    /// Lets whoever keeps the time of a drive's group see to its connections and its memory, too.
    pub(crate) fn look_after(&self, drive: usize) {
        if let Some(cell) = self.cells.get(self.group_of(drive)) {
            cell.wake_changed.notify_one();
        }
    }

    /// Adds to the recording, if one is made. To be called while the group that it is about is locked, so that what is
    /// recorded is in the order in which it happened.
    pub(crate) fn write(&self, entry: impl FnOnce() -> Entry) {
        if let Some(recorder) = self.recorder() {
            recorder.write(&entry());
        }
    }

    /// Waits until something in a group is due, or what is due has changed.
    pub(crate) async fn wait(&self, number: usize) {
        let Some(cell) = self.cells.get(number) else { return std::future::pending().await };
        let wake = cell.lock().next_wake();
        tokio::select! {
            () = cell.wake_changed.notified() => {}
            () = self.clock.sleep_until(wake) => {}
        }
    }

    /// Brings a group up to the present. What takes too long makes rig time go slower.
    fn bring_up(&self, group: &mut Group) {
        let now = self.clock.now();
        let reached = group.advance(now, &mut SLICE.clone());
        settle(group);
        if reached < now {
            self.clock.hold_back(reached);
        }
    }

    fn lock_play(&self) -> MutexGuard<'_, Option<Box<dyn Play>>> {
        self.play.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Cell {
    fn lock(&self) -> MutexGuard<'_, Group> {
        // A panic while the lock was held is our bug; the group itself is whole, since every step of it is.
        self.group.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Rings when the group wants to be woken at another time than is expected.
    fn expect(&self, group: &Group) {
        let wake = group.next_wake().map_or(u64::MAX, Instant::as_nanos);
        if self.expected.swap(wake, Ordering::Relaxed) != wake {
            self.wake_changed.notify_one();
        }
    }
}

/// For each drive the number of its group, and which member of it.
pub(crate) fn places(rig: &RigFile, groups: &[Group]) -> Vec<(usize, usize)> {
    let mut places = vec![(0, 0); rig.drives.len()];
    for (number, group) in groups.iter().enumerate() {
        for (place, member) in group.members().iter().enumerate() {
            if let Some(drive) = places.get_mut(member.drive()) {
                *drive = (number, place);
            }
        }
    }
    places
}

/// Lets everything happen that is due at the time at which a group stands, even where the budget was used up in the middle
/// of that instant, or the group is ahead of a clock that was held back: whatever is done to the group now comes after it.
/// A recording depends on that, since it has no more than the time.
pub(crate) fn settle(group: &mut Group) {
    while !is_settled(group) {
        group.advance(group.now(), &mut SLICE.clone());
    }
}

/// Whether everything has happened that is due at the time at which a group stands.
pub(crate) fn is_settled(group: &Group) -> bool {
    group.next_wake().is_none_or(|wake| wake > group.now())
}

/// The groups of a rig whose machines have just been switched on.
pub(crate) fn build(rig: &RigFile, machines: Vec<AnyMachine>) -> Vec<Group> {
    let mut machines: Vec<Option<AnyMachine>> = machines.into_iter().map(Some).collect();
    let mut take = |drive: usize| Some((drive, machines.get_mut(drive)?.take()?));
    let groups = rig.groups().into_iter();
    groups
        .map(|drives| Group::new(drives.into_iter().filter_map(&mut take).collect(), &rig.wires, rig.seed))
        .collect()
}
