//! `--serve`, by HTTP.

use std::io::{Read as _, Write as _};
use std::net::{TcpListener, TcpStream};
use std::time::{Duration, Instant};

use serde_json::Value;

use super::{Running, run, stderr, written};

/// An answer.
pub struct Answer {
    pub status: u16,
    pub head: String,
    pub body: Vec<u8>,
}

impl Answer {
    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap_or_else(|error| panic!("{error}: {}", self.text()))
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(&self.body).into_owned()
    }

    /// The value of a header field.
    fn field(&self, name: &str) -> Option<&str> {
        let fields = self.head.lines().filter_map(|line| line.split_once(": "));
        fields
            .into_iter()
            .find(|(field, _)| field.eq_ignore_ascii_case(name))
            .map(|(_, value)| value)
    }
}

/// Sends a request, and reads its answer.
fn exchange(port: u16, request: &str) -> Option<Answer> {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).ok()?;
    stream.set_read_timeout(Some(Duration::from_secs(20))).ok()?;
    stream.write_all(request.as_bytes()).ok()?;
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).ok()?;
    let end = bytes.windows(4).position(|window| window == b"\r\n\r\n")?;
    let head = String::from_utf8(bytes[..end].to_vec()).ok()?;
    Some(Answer {
        status: head.split(' ').nth(1)?.parse().ok()?,
        head,
        body: bytes[end + 4..].to_vec(),
    })
}

fn request(port: u16, line: &str, host: &str) -> Answer {
    let text = format!("{line} HTTP/1.1\r\nHost: {host}\r\nUser-Agent: test\r\n\r\n");
    exchange(port, &text).unwrap_or_else(|| panic!("no answer to {line}"))
}

pub fn get(port: u16, path: &str) -> Answer {
    request(port, &format!("GET {path}"), &format!("127.0.0.1:{port}"))
}

/// Starts a render with a page; returns its port.
pub fn serve(folder: &std::path::Path, arguments: &[&str]) -> (Running, u16) {
    let all = [&["--serve", "0"], arguments].concat();
    let running = Running::start(folder, &all);
    let line = running.line("http://");
    let port = line
        .trim_end_matches('/')
        .rsplit(':')
        .next()
        .and_then(|port| port.parse().ok());
    (running, port.unwrap_or_else(|| panic!("no port in {line}")))
}

/// Asks for the status until it is as wanted.
pub fn status_when(port: u16, what: &str, is_wanted: impl Fn(&Value) -> bool) -> Value {
    let end = Instant::now() + Duration::from_secs(60);
    loop {
        let status = get(port, "/status").json();
        if is_wanted(&status) {
            return status;
        }
        assert!(Instant::now() < end, "not within a minute: {what}; {status}");
        std::thread::sleep(Duration::from_millis(50));
    }
}

/// Asks until there is a picture whose error is known.
pub fn status_with_error(port: u16) -> Value {
    status_when(port, "an error is known", |status| {
        status["picture"]["iteration"].as_u64() >= Some(4) && !status["progress"]["estimated_error"].is_null()
    })
}

/// The values of half floats.
fn halves(bytes: &[u8]) -> Vec<f32> {
    let value = |pair: &[u8]| half::f16::from_le_bytes([pair[0], pair[1]]).to_f32();
    bytes.chunks(2).map(value).collect()
}

#[test]
fn a_page_shows_the_render_as_it_goes_on() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut running, port) = serve(folder.path(), &["--time", "4", "--max-depth", "1"]);
    let page = get(port, "/");
    assert_eq!(
        (page.status, page.field("Content-Type")),
        (200, Some("text/html; charset=utf-8"))
    );
    let policy = page.field("Content-Security-Policy").expect("a policy").to_owned();
    assert!(
        policy.starts_with("default-src 'none'") && !policy.contains("unsafe"),
        "{policy}"
    );
    let again = get(port, "/").head;
    assert!(!again.contains(&policy), "the policy's number is new each time");
    for outside in ["http:", "https:", "src=", "@import", "url("] {
        assert!(!page.text().contains(outside), "the page has «{outside}»");
    }
    let status = status_with_error(port);
    assert_eq!(status["title"], "o.exr");
    assert_eq!(status["picture"]["resolution"], serde_json::json!([32, 24]));
    assert!(
        status["errors"].as_array().is_some_and(|points| !points.is_empty()),
        "{status}"
    );
    let stages: Vec<_> = status["stages"]
        .as_array()
        .expect("stages")
        .iter()
        .map(|stage| stage["stage"].clone())
        .collect();
    assert!(
        stages.contains(&"photons".into()) && stages.contains(&"direct".into()),
        "{status}"
    );
    let before = get(port, "/picture");
    assert_eq!(
        (before.body.len(), before.field("Picture-Size")),
        (32 * 24 * 6, Some("32x24"))
    );
    let error = halves(&get(port, "/error").body);
    assert_eq!(error.len(), 32 * 24 * 3);
    assert!(error.iter().all(|value| *value >= 0.0) && error.iter().any(|value| *value > 0.0));
    let share = status["snapshot_seconds"].as_f64().expect("seconds")
        / status["progress"]["rendering_seconds"].as_f64().expect("seconds");
    assert!(share < 0.5, "a second a picture: {share}");

    // The program waits a moment for the browser to fetch the last picture.
    let last = status_when(port, "its end", |status| !status["end"].is_null());
    assert_eq!(last["end"], "done");
    assert!(
        last["warnings"].as_array().is_some_and(|warnings| !warnings.is_empty()),
        "{last}"
    );
    let picture = get(port, "/picture");
    assert_eq!(
        picture.field("Picture-Version"),
        Some(last["picture"]["version"].to_string().as_str())
    );
    assert_eq!(running.code(), Some(0));
    let expected: Vec<f32> = written(folder.path())
        .pixels()
        .iter()
        .flatten()
        .map(|value| half::f16::from_f32(*value).to_f32())
        .collect();
    assert!(
        halves(&picture.body) == expected,
        "the last picture isn't that of the file"
    );
}

#[test]
fn a_page_is_only_read_and_only_by_its_own_names() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_running, port) = serve(folder.path(), &["--time", "1000"]);
    for (line, host, status) in [
        ("GET /", "localhost", 200),
        ("GET /", "localhost:9999", 200),
        ("GET /status", "[::1]:80", 200),
        ("GET /nothing", "localhost", 404),
        ("GET /../Cargo.toml", "localhost", 404),
        ("GET /", "example.com", 403),
        ("GET /status", "127.0.0.1.example.com", 403),
        ("GET /picture", &format!("rebound.example:{port}"), 403),
        ("POST /", "localhost", 405),
        ("PUT /picture", "localhost", 405),
        ("DELETE /status", "localhost", 405),
        ("OPTIONS /", "localhost", 405),
    ] {
        let answer = request(port, line, host);
        assert_eq!(answer.status, status, "{line}, Host: {host}: {}", answer.text());
        assert_eq!(answer.field("Access-Control-Allow-Origin"), None, "{line}");
        assert_eq!(answer.field("X-Content-Type-Options"), Some("nosniff"), "{line}");
        assert_eq!(
            answer.field("Content-Length"),
            Some(answer.body.len().to_string().as_str()),
            "{line}"
        );
    }
    assert_eq!(request(port, "POST /", "localhost").field("Allow"), Some("GET, HEAD"));
    let head = request(port, "HEAD /", "localhost");
    assert!(
        head.status == 200 && head.body.is_empty() && head.field("Content-Length") != Some("0"),
        "{}",
        head.head
    );
    let status = |request: &str| exchange(port, request).map(|answer| answer.status);
    assert_eq!(status("GET / HTTP/1.1\r\n\r\n"), Some(400), "no Host");
    assert_eq!(status("hello\r\n\r\n"), Some(400));
    assert_eq!(
        status(&format!(
            "GET / HTTP/1.1\r\nHost: localhost\r\nX: {}\r\n\r\n",
            "x".repeat(1 << 15)
        )),
        Some(431)
    );
    let body = format!(
        "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 50000\r\n\r\n{}",
        "x".repeat(50_000)
    );
    assert_eq!(status(&body), Some(405), "with a body");
}

#[test]
fn a_browser_that_says_nothing_stops_nobody() {
    let folder = tempfile::tempdir().expect("a folder");
    let (_running, port) = serve(folder.path(), &["--time", "1000"]);
    let silent: Vec<TcpStream> = (0..20)
        .map(|_| TcpStream::connect(("127.0.0.1", port)).expect("a connection"))
        .collect();
    assert_eq!(get(port, "/status").status, 200);
    drop(silent);
}

#[test]
fn a_port_that_is_taken_is_told_before_the_render() {
    let taken = TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = taken.local_addr().expect("an address").port().to_string();
    let folder = tempfile::tempdir().expect("a folder");
    let output = run(folder.path(), &["--iterations", "1", "--serve", &port]);
    let text = stderr(&output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    assert_eq!(text.lines().count(), 1, "{text}");
    assert!(
        text.starts_with("error: ") && text.contains(&port) && text.contains("in use"),
        "{text}"
    );
    assert!(!folder.path().join("o.exr").exists());
}
