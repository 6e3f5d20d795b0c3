//! Signals that ask to stop (Ctrl-C, SIGTERM, SIGHUP): the first one asks the render to end and to write its picture, one more
//! ends the process at once, unless it is writing.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use ppm_vk::internals::files;

/// Signals that follow the one before within this time are the same request: `timeout` sends to the process and then to its group,
/// and a key that is held repeats.
const ONE_REQUEST: Duration = Duration::from_secs(1);

static ASKED: AtomicBool = AtomicBool::new(false);

/// Tells requests from repeats of the last one.
#[derive(Debug)]
struct Requests(Option<Instant>);

/// What a signal asks for.
#[derive(Debug, PartialEq, Eq)]
enum Request {
    /// To stop.
    Stop,
    /// The same that was asked for before.
    Repeat,
    /// To end at once.
    End,
}

impl Requests {
    fn at(&mut self, now: Instant) -> Request {
        match self.0 {
            None => {
                self.0 = Some(now);
                Request::Stop
            }
            Some(last) if now.saturating_duration_since(last) < ONE_REQUEST => Request::Repeat,
            Some(_) => Request::End,
        }
    }
}

fn on_signal(end: impl FnOnce()) {
    static REQUESTS: Mutex<Requests> = Mutex::new(Requests(None));
    let request = REQUESTS
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .at(Instant::now());
    match request {
        Request::Stop => ASKED.store(true, Ordering::Relaxed),
        Request::Repeat => {}
        Request::End => files::unless_writing(end),
    }
}

/// Installs the handler, for the signals that the process isn't told to ignore (`nohup`, jobs in the background).
#[cfg(unix)]
pub fn install() -> Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let signals = [SIGINT, SIGTERM, SIGHUP]
        .into_iter()
        .filter(|&signal| !is_ignored(signal));
    let mut signals = signal_hook::iterator::Signals::new(signals).context("no handler for Ctrl-C")?;
    std::thread::spawn(move || {
        for _ in signals.forever() {
            // Nothing is torn down: the device's threads are still at work.
            on_signal(|| signal_hook::low_level::exit(130));
        }
    });
    Ok(())
}

/// The same where there are no signals.
#[cfg(not(unix))]
pub fn install() -> Result<()> {
    ctrlc::set_handler(|| on_signal(|| std::process::exit(130))).context("no handler for Ctrl-C")
}

/// Whether a signal was ignored when the program started. Linux tells; elsewhere SIGHUP is taken to be, so that `nohup` works.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else {
        return signal == signal_hook::consts::SIGHUP;
    };
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Has writing past a limit of file sizes fail with an error, as on a full disk, instead of killing the process.
pub fn survive_file_limits() -> Result<()> {
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default())
        .context("no handler for SIGXFSZ")?;
    Ok(())
}

/// Whether the user has asked to stop.
pub fn asked() -> bool {
    ASKED.load(Ordering::Relaxed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn repeats_within_a_second_are_one_request() {
        let start = Instant::now();
        let mut requests = Requests(None);
        let at = |milliseconds| start + Duration::from_millis(milliseconds);
        let found = [0, 1, 10, 900, 1100].map(|time| requests.at(at(time)));
        let wanted = [
            Request::Stop,
            Request::Repeat,
            Request::Repeat,
            Request::Repeat,
            Request::End,
        ];
        assert_eq!(found, wanted);
    }
}
