//! Signals that ask to stop (Ctrl-C, SIGTERM, SIGHUP): the first one ends the render and writes its picture, a second one ends
//! the process at once, unless it is writing.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use anyhow::{Context, Result};

use ppm_vk::internals::files;

/// Signals within this time after the previous one are the same request: `timeout` signals the process and then its group, and a
/// held key repeats.
const ONE_REQUEST: Duration = Duration::from_secs(1);

static ASKED: AtomicBool = AtomicBool::new(false);

/// Distinguishes requests from repeats of the last one.
#[derive(Debug)]
struct Requests(Option<Instant>);

/// The request of a signal.
#[derive(Debug, PartialEq, Eq)]
enum Request {
    /// Stop.
    Stop,
    /// A repeat of the previous request.
    Repeat,
    /// End at once.
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

/// Installs the handler, for the signals that the process does not have to ignore (`nohup`, background jobs).
#[cfg(unix)]
pub fn install() -> Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    let signals = [SIGINT, SIGTERM, SIGHUP]
        .into_iter()
        .filter(|&signal| !is_ignored(signal));
    let mut signals = signal_hook::iterator::Signals::new(signals).context("no handler for Ctrl-C")?;
    std::thread::spawn(move || {
        for _ in signals.forever() {
            // No destructors run: the device's threads are still active.
            on_signal(|| signal_hook::low_level::exit(130));
        }
    });
    Ok(())
}

/// The same for systems without signals.
#[cfg(not(unix))]
pub fn install() -> Result<()> {
    ctrlc::set_handler(|| on_signal(|| std::process::exit(130))).context("no handler for Ctrl-C")
}

/// Whether a signal was ignored when the program started. Known on Linux; elsewhere assumed for SIGHUP, so that `nohup` works.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let Ok(status) = std::fs::read_to_string("/proc/self/status") else {
        return signal == signal_hook::consts::SIGHUP;
    };
    let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
    ignored.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
}

/// Makes writes beyond a limit of file sizes fail with an error, as on a full disk, instead of killing the process.
pub fn survive_file_limits() -> Result<()> {
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, std::sync::Arc::default())
        .context("no handler for SIGXFSZ")?;
    Ok(())
}

/// Whether the user has asked to stop.
pub fn requested() -> bool {
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
