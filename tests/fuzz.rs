//! Damaged or inconsistent files load, or fail with one line. There must be no panic, no hang, and no memory use beyond a bound.
//! Each file is generated from a number, so that a failure can be reproduced.

use std::sync::Mutex;
use std::time::{Duration, Instant};

#[path = "fuzz/allocations.rs"]
mod allocations;
#[path = "fuzz/damage.rs"]
mod damage;
// The loader's tests use these too.
#[allow(dead_code)]
#[path = "scene/encoded.rs"]
mod encoded;
#[allow(dead_code)]
#[path = "scene/fixture.rs"]
mod fixture;
#[path = "fuzz/inputs.rs"]
mod inputs;
#[path = "fuzz/originals.rs"]
mod originals;
#[path = "fuzz/survival.rs"]
mod survival;

use survival::{Outcome, Watch};

/// One run at a time: memory is counted for the whole process.
static RUNS: Mutex<()> = Mutex::new(());

/// Damages the originals in turn, with consecutive numbers from `first` until `is_enough`, which gets the count and the elapsed
/// time.
fn survive(first: u64, is_enough: impl Fn(u64, Duration) -> bool) {
    let _alone = RUNS.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let originals = originals::all();
    for original in &originals {
        let outcome = original.read();
        assert_eq!(outcome, Outcome::Loaded, "{} should load unharmed", original.name());
    }
    let start = Instant::now();
    let mut tally = vec![[0u64; 2]; originals.len()];
    let mut done = 0;
    let watch = Watch::start();
    while !is_enough(done, start.elapsed()) {
        let number = first + done;
        let index = (number % originals.len() as u64) as usize;
        let outcome = watch.over(number, originals[index].name(), || originals[index].damaged(number));
        tally[index][usize::from(outcome == Outcome::Refused)] += 1;
        done += 1;
    }
    println!(
        "{done} files in {:.1} s, peak {} MiB:",
        start.elapsed().as_secs_f64(),
        watch.peak() >> 20
    );
    for (original, [loaded, refused]) in originals.iter().zip(&tally) {
        println!("{:<28} {loaded} loaded, {refused} refused", original.name());
        let all = loaded + refused;
        assert!(
            all < 100 || (*loaded > all / 50 && *refused > all / 50),
            "{}: {loaded} of {all} load: too much or too little damage",
            original.name()
        );
    }
}

#[test]
fn mutated_files_neither_panic_nor_hang_nor_take_all_memory() {
    survive(0, |done, _| done == 3000);
}

#[test]
fn any_value_of_a_scene_may_be_replaced_by_any_other() {
    let _alone = RUNS.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let watch = Watch::start();
    let outcomes = originals::with_replaced_values(|number, read| watch.over(number, "the room", read));
    let loaded = outcomes.iter().filter(|outcome| **outcome == Outcome::Loaded).count();
    assert!(
        0 < loaded && loaded < outcomes.len(),
        "{loaded} of {} load",
        outcomes.len()
    );
}

#[test]
#[ignore = "takes a minute"]
fn a_minute_of_mutated_files_is_survived() {
    survive(1 << 32, |_, time| time > Duration::from_secs(60));
}

#[test]
#[ignore = "takes minutes"]
fn fifty_thousand_mutated_files_are_survived() {
    survive(1 << 40, |done, _| done == 50_000);
}
