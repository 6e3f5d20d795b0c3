//! HTTP for a page that only reads: one request for each connection, answered or refused.

use std::io::{ErrorKind, Read as _, Write as _};
use std::net::{IpAddr, Shutdown, TcpStream};
use std::time::{Duration, Instant};

/// Maximum size of a request, in bytes.
const MAX_REQUEST: usize = 16 << 10;
/// Maximum number of its header fields.
const MAX_FIELDS: usize = 64;
/// Maximum time that a request may take to arrive.
const REQUEST_TIME: Duration = Duration::from_secs(10);
/// Maximum time without progress of an answer.
const ANSWER_TIME: Duration = Duration::from_secs(30);

/// A valid request to read something.
#[derive(Debug, PartialEq, Eq)]
pub struct Request {
    /// The path, without a query.
    pub path: String,
    /// Whether the answer has no body.
    pub is_head: bool,
}

/// An answer.
#[derive(Debug)]
pub struct Answer {
    /// Code and reason.
    pub status: &'static str,
    /// Type of the body.
    pub content_type: &'static str,
    /// More header fields, each with its line end.
    pub fields: String,
    /// The body.
    pub body: Vec<u8>,
}

impl Answer {
    /// A success.
    pub fn ok(content_type: &'static str, body: Vec<u8>) -> Self {
        Self {
            status: "200 OK",
            content_type,
            fields: String::new(),
            body,
        }
    }

    /// A refusal, with a line that says why.
    pub fn refusal(status: &'static str, why: &str) -> Self {
        Self {
            status,
            content_type: "text/plain; charset=utf-8",
            fields: String::new(),
            body: format!("{why}\n").into_bytes(),
        }
    }
}

/// Answers the request of a connection. `host` is the name that the server was started with.
pub fn serve(mut stream: TcpStream, host: &str, answer: impl FnOnce(&Request) -> Answer) {
    let (answer, is_head) = match receive(&mut stream) {
        None => return,
        Some(bytes) => match check(&bytes, host) {
            Ok(request) => (answer(&request), request.is_head),
            Err(refusal) => (refusal, false),
        },
    };
    // A browser that has gone is no error.
    let _ = send(&mut stream, &answer, is_head);
}

/// The request's bytes up to its empty line, or as many as are accepted; `None` if it does not arrive.
fn receive(stream: &mut TcpStream) -> Option<Vec<u8>> {
    let end = Instant::now() + REQUEST_TIME;
    let mut bytes = Vec::new();
    let mut chunk = [0; 4096];
    while !bytes.windows(4).any(|window| window == b"\r\n\r\n") && bytes.len() <= MAX_REQUEST {
        let left = end
            .checked_duration_since(Instant::now())
            .filter(|left| !left.is_zero())?;
        stream.set_read_timeout(Some(left)).ok()?;
        match stream.read(&mut chunk) {
            Ok(0) => return None,
            Ok(count) => bytes.extend(&chunk[..count]),
            Err(error) if error.kind() == ErrorKind::Interrupted => {}
            Err(_) => return None,
        }
    }
    Some(bytes)
}

/// Checks a request.
fn check(bytes: &[u8], host: &str) -> Result<Request, Answer> {
    let mut fields = [httparse::EMPTY_HEADER; MAX_FIELDS];
    let mut parsed = httparse::Request::new(&mut fields);
    let bad = |why: &str| Answer::refusal("400 Bad Request", why);
    match parsed.parse(bytes) {
        Ok(httparse::Status::Complete(_)) => {}
        Ok(httparse::Status::Partial) | Err(httparse::Error::TooManyHeaders) => {
            let why = "the request is too large";
            return Err(Answer::refusal("431 Request Header Fields Too Large", why));
        }
        Err(error) => return Err(bad(&format!("this is no HTTP request: {error}"))),
    }
    let hosts: Vec<&[u8]> = parsed
        .headers
        .iter()
        .filter(|field| field.name.eq_ignore_ascii_case("host"))
        .map(|field| field.value)
        .collect();
    let [asked] = hosts[..] else {
        return Err(bad("a request has one Host field"));
    };
    if !std::str::from_utf8(asked).is_ok_and(|asked| is_own(asked, host)) {
        // Another site's name that leads here: its pages must not read this one.
        let why = "this server has another name: open it by its address, or by localhost";
        return Err(Answer::refusal("403 Forbidden", why));
    }
    let method = parsed.method.unwrap_or_default();
    if !["GET", "HEAD"].contains(&method) {
        return Err(Answer {
            fields: "Allow: GET, HEAD\r\n".to_owned(),
            ..Answer::refusal("405 Method Not Allowed", "everything here is only to be read")
        });
    }
    let target = parsed.path.unwrap_or_default();
    let path = target.split(['?', '#']).next().unwrap_or_default();
    if !path.starts_with('/') {
        return Err(bad("the target of a request is a path"));
    }
    Ok(Request {
        path: path.to_owned(),
        is_head: method == "HEAD",
    })
}

/// Whether a Host field names this server: an address, which no other site's pages can have, this computer, or the name that the
/// server was started with. Ports may differ: tunnels have their own.
fn is_own(asked: &str, host: &str) -> bool {
    let has_port =
        |rest: &str| rest.is_empty() || rest.strip_prefix(':').is_some_and(|port| port.parse::<u16>().is_ok());
    if let Some(rest) = asked.strip_prefix('[') {
        let parts = rest.split_once(']');
        return parts.is_some_and(|(address, rest)| address.parse::<IpAddr>().is_ok() && has_port(rest));
    }
    let (name, rest) = asked.split_at(asked.find(':').unwrap_or(asked.len()));
    let is_known = [host, "localhost"].iter().any(|own| name.eq_ignore_ascii_case(own));
    !name.is_empty() && has_port(rest) && (is_known || name.parse::<IpAddr>().is_ok())
}

fn send(stream: &mut TcpStream, answer: &Answer, is_head: bool) -> std::io::Result<()> {
    let Answer {
        status,
        content_type,
        fields,
        body,
    } = answer;
    let head = format!(
        "HTTP/1.1 {status}\r\n\
         Content-Type: {content_type}\r\n\
         Content-Length: {}\r\n\
         Connection: close\r\n\
         Cache-Control: no-store\r\n\
         Cross-Origin-Resource-Policy: same-origin\r\n\
         Referrer-Policy: no-referrer\r\n\
         X-Content-Type-Options: nosniff\r\n\
         {fields}\r\n",
        body.len()
    );
    stream.set_write_timeout(Some(ANSWER_TIME))?;
    stream.write_all(head.as_bytes())?;
    if !is_head {
        stream.write_all(body)?;
    }
    stream.flush()?;
    stream.shutdown(Shutdown::Write)?;
    // Closing with bytes unread, as of a refused request's body, could reset the connection before the answer is read.
    stream.set_read_timeout(Some(Duration::from_secs(1)))?;
    let mut chunk = [0; 4096];
    for _ in 0..MAX_FIELDS {
        if stream.read(&mut chunk)? == 0 {
            break;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status_of(request: &str, host: &str) -> String {
        match check(request.as_bytes(), host) {
            Ok(request) => format!("{} {}", if request.is_head { "HEAD" } else { "GET" }, request.path),
            Err(refusal) => refusal.status[..3].to_owned(),
        }
    }

    #[test]
    fn only_reading_is_allowed_and_only_by_own_names() {
        let with = |line: &str, host: &str| status_of(&format!("{line} HTTP/1.1\r\nHost: {host}\r\n\r\n"), "desk");
        for (line, host, expected) in [
            ("GET /", "localhost", "GET /"),
            ("GET /status?x=1", "127.0.0.1:8000", "GET /status"),
            ("HEAD /", "[::1]:9", "HEAD /"),
            ("GET /", "DESK:8000", "GET /"),
            ("GET /", "192.168.0.7", "GET /"),
            ("GET /", "example.com", "403"),
            ("GET /", "localhost.example.com", "403"),
            ("GET /", "127.0.0.1.example.com", "403"),
            ("GET /", "desk:8000:1", "403"),
            ("GET /", "localhost:port", "403"),
            ("GET /", "[desk]", "403"),
            ("GET /", "", "403"),
            ("POST /", "localhost", "405"),
            ("OPTIONS *", "localhost", "405"),
            ("DELETE /", "example.com", "403"),
            ("GET http://localhost/", "localhost", "400"),
        ] {
            assert_eq!(with(line, host), expected, "{line}, Host: {host}");
        }
        assert_eq!(status_of("GET / HTTP/1.1\r\n\r\n", "desk"), "400", "no Host");
        let two = "GET / HTTP/1.1\r\nHost: localhost\r\nHost: example.com\r\n\r\n";
        assert_eq!(status_of(two, "desk"), "400", "two of them");
        assert_eq!(status_of("\u{1}\r\n\r\n", "desk"), "400");
        let many = "a: b\r\n".repeat(MAX_FIELDS + 1);
        assert_eq!(status_of(&format!("GET / HTTP/1.1\r\n{many}\r\n"), "desk"), "431");
    }
}
