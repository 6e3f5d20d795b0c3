//! A page for browsers that shows a render as it goes on (`--serve`).

mod board;
mod http;

pub use board::Board;

use std::hash::{BuildHasher as _, Hasher as _, RandomState};
use std::io::ErrorKind;
use std::net::TcpListener;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use anyhow::{Context as _, Result, anyhow};

use super::events::Events;
use super::takers::{Pace, Taker};
use super::view::Address;
use http::{Answer, Request};
use ppm_vk::{Rendered, Snapshot, Wanted};

/// The page: it loads nothing but the render's own data.
const PAGE: &str = include_str!("page.html");
/// Maximum number of connections at a time.
const MAX_CONNECTIONS: usize = 32;

/// Parses `PORT`, on this computer alone, or `HOST:PORT`.
pub fn address(text: &str) -> Result<Address, String> {
    if let Ok(port) = text.parse() {
        let host = "127.0.0.1".to_owned();
        return Ok(Address { host, port });
    }
    Address::parse(text).map_err(|_| "expected PORT or HOST:PORT, such as 8000".to_owned())
}

/// Serves the page until the process ends.
///
/// # Errors
/// An address that can't be listened on.
pub fn start(address: &Address, board: &Arc<Board>, events: &Events) -> Result<()> {
    let listener = TcpListener::bind(address.to_string()).map_err(|error| {
        if error.kind() == ErrorKind::AddrInUse {
            anyhow!("--serve {address}: the port is in use; choose another one, or 0 for any that is free")
        } else {
            anyhow!("--serve {address}: can't be listened on ({error})")
        }
    })?;
    let port = listener.local_addr().context("--serve: no address")?.port();
    let host = address.host.clone();
    events.note(format!("the picture so far is shown at http://{host}:{port}/"));
    let board = board.clone();
    thread::spawn(move || accept(&listener, &host, &board));
    Ok(())
}

fn accept(listener: &TcpListener, host: &str, board: &Arc<Board>) {
    let open = Arc::new(AtomicUsize::new(0));
    for stream in listener.incoming().flatten() {
        // More are closed at once: a browser uses few, and asks again.
        if open.fetch_add(1, Ordering::Relaxed) >= MAX_CONNECTIONS {
            open.fetch_sub(1, Ordering::Relaxed);
            continue;
        }
        let (open, host, board) = (open.clone(), host.to_owned(), board.clone());
        thread::spawn(move || {
            let mut fetched = None;
            http::serve(stream, &host, |request| answer(request, &board, &mut fetched));
            if let Some(version) = fetched {
                board.fetched(version);
            }
            open.fetch_sub(1, Ordering::Relaxed);
        });
    }
}

/// The answer to a request. `fetched`: the version of the picture in it.
fn answer(request: &Request, board: &Board, fetched: &mut Option<u64>) -> Answer {
    match request.path.as_str() {
        "/" => page(),
        "/status" => Answer::ok("application/json", board.status().to_string().into_bytes()),
        path @ ("/picture" | "/error") => {
            let Some((version, pixels)) = board.pixels(path == "/error") else {
                return Answer::refusal("404 Not Found", "there is no picture yet");
            };
            *fetched = Some(version);
            let [width, height] = pixels.size;
            Answer {
                fields: format!("Picture-Size: {width}x{height}\r\nPicture-Version: {version}\r\n"),
                ..Answer::ok("application/octet-stream", pixels.bytes)
            }
        }
        _ => Answer::refusal("404 Not Found", "there is no such page"),
    }
}

/// The page, whose only scripts and styles are its own: those with a number that nobody else knows.
fn page() -> Answer {
    let nonce = format!(
        "{:016x}{:016x}",
        RandomState::new().build_hasher().finish(),
        RandomState::new().build_hasher().finish()
    );
    Answer {
        fields: format!(
            "Content-Security-Policy: default-src 'none'; script-src 'nonce-{nonce}'; style-src 'nonce-{nonce}'; \
             connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n"
        ),
        ..Answer::ok("text/html; charset=utf-8", PAGE.replace("NONCE", &nonce).into_bytes())
    }
}

/// Shows snapshots on the page while a browser does.
pub struct Page {
    board: Arc<Board>,
    pace: Pace,
}

impl Page {
    /// On this board.
    pub fn new(board: Arc<Board>) -> Self {
        Self {
            board,
            pace: Pace::of_a_view(),
        }
    }
}

impl Taker for Page {
    fn wants(&self) -> Option<Wanted> {
        self.pace.wants().filter(|_| self.board.is_watched())
    }

    fn take(&self, snapshot: &Snapshot) {
        self.pace.taken(snapshot.cost);
        self.board.show(snapshot);
    }

    fn end(self: Box<Self>, last: Option<&Arc<Rendered>>) {
        if let Some(last) = last {
            self.board.show_last(last);
        }
    }
}
