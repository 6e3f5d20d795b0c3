//! The picture so far in tev, an image viewer that listens on TCP (github.com/Tom94/tev).
//!
//! A packet of its protocol is its length as u32, with these four bytes, a byte for its kind, and fields without padding: numbers
//! in little-endian order, truth values of one byte, names that end with a zero byte.

use std::fmt;
use std::io::Write as _;
use std::net::{TcpStream, ToSocketAddrs as _};
use std::sync::Arc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use anyhow::{Context as _, Result, anyhow};

use super::events::Events;
use super::takers::{Mailbox, Pace, Taker};
use ppm_vk::{Rendered, Snapshot, Wanted};

/// Where tev listens.
pub const DEFAULT_ADDRESS: &str = "127.0.0.1:14158";
/// Longest wait for a viewer that does not answer.
const PATIENCE: Duration = Duration::from_secs(5);

/// The kinds of packets that are sent.
const CREATE_IMAGE: u8 = 4;
/// Its third version: with offsets and strides of channels.
const UPDATE_IMAGE: u8 = 6;
const CHANNELS: [&str; 4] = ["R", "G", "B", "A"];
/// Approximate size of an update, in bytes.
const BAND_BYTES: usize = 1 << 20;

/// A host and a port.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Address {
    /// A name, or an address; one of IPv6 in brackets.
    pub host: String,
    /// The port.
    pub port: u16,
}

impl Address {
    /// Parses HOST:PORT.
    pub fn parse(text: &str) -> Result<Self, String> {
        let expected = || "expected HOST:PORT, such as 127.0.0.1:14158".to_owned();
        let (host, port) = text.rsplit_once(':').ok_or_else(expected)?;
        let is_bracketed = host.starts_with('[') && host.ends_with(']');
        if host.is_empty() || host.contains(':') && !is_bracketed || host.contains(char::is_whitespace) {
            return Err(expected());
        }
        Ok(Self {
            host: host.to_owned(),
            port: port.parse().map_err(|_| expected())?,
        })
    }
}

impl fmt::Display for Address {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(text, "{}:{}", self.host, self.port)
    }
}

/// Shows pictures in a viewer, on a thread of its own.
pub struct Viewer {
    pace: Pace,
    pictures: Arc<Mailbox<Arc<Rendered>>>,
    thread: JoinHandle<()>,
}

impl Viewer {
    /// Connects to the viewer at this address, which shows pictures by this name.
    pub fn new(address: Address, name: String, events: &Arc<Events>) -> Self {
        let pictures = Arc::new(Mailbox::default());
        let (incoming, events) = (pictures.clone(), events.clone());
        let thread = thread::spawn(move || {
            if let Err(error) = show(&address, &name, &incoming) {
                events.warning(format!("--view {address}: {error:#}; the render goes on without it"));
            }
        });
        Self {
            pace: Pace::of_a_view(),
            pictures,
            thread,
        }
    }
}

impl Taker for Viewer {
    fn wants(&self) -> Option<Wanted> {
        self.pace.wants().filter(|_| self.pictures.is_awaited())
    }

    fn take(&self, snapshot: &Snapshot) {
        self.pace.taken(snapshot.cost);
        self.pictures.put(snapshot.rendered.clone());
    }

    fn end(self: Box<Self>, last: Option<&Arc<Rendered>>) {
        if let Some(last) = last {
            self.pictures.put(last.clone());
        }
        self.pictures.close();
        // A panic there has been told by its own message.
        let _ = self.thread.join();
    }
}

fn show(address: &Address, name: &str, pictures: &Mailbox<Arc<Rendered>>) -> Result<()> {
    let mut viewer = connect(address).context("there is no viewer (start tev first)")?;
    let mut is_new = true;
    while let Some(rendered) = pictures.next() {
        if std::mem::take(&mut is_new) {
            let [width, height] = [rendered.image().width(), rendered.image().height()];
            viewer.write_all(&create(name, width, height))?;
        }
        for band in updates(name, &rendered) {
            viewer.write_all(&band).context("the viewer is gone")?;
        }
    }
    Ok(())
}

fn connect(address: &Address) -> Result<TcpStream> {
    let mut failure = anyhow!("this name has no address");
    for place in address.to_string().to_socket_addrs()? {
        match TcpStream::connect_timeout(&place, PATIENCE) {
            Ok(stream) => {
                stream.set_write_timeout(Some(PATIENCE))?;
                return Ok(stream);
            }
            Err(error) => failure = error.into(),
        }
    }
    Err(failure)
}

/// A packet of a kind about an image, with these fields after its name.
fn packet(kind: u8, takes_focus: bool, name: &str, fields: &[&[u8]]) -> Vec<u8> {
    let head = [kind, u8::from(takes_focus)];
    let bytes = 4 + head.len() + name.len() + 1 + fields.iter().map(|field| field.len()).sum::<usize>();
    let mut packet = Vec::with_capacity(bytes);
    packet.extend((bytes as u32).to_le_bytes());
    packet.extend(head);
    packet.extend(name.bytes().map(|byte| if byte == 0 { b'?' } else { byte }));
    packet.push(0);
    fields.iter().for_each(|field| packet.extend(*field));
    packet
}

fn numbers(numbers: &[usize]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|&number| (number as i32).to_le_bytes())
        .collect()
}

fn long_numbers(numbers: &[usize]) -> Vec<u8> {
    numbers
        .iter()
        .flat_map(|&number| (number as i64).to_le_bytes())
        .collect()
}

fn channel_names() -> Vec<u8> {
    CHANNELS
        .iter()
        .flat_map(|name| [name.as_bytes(), b"\0"].concat())
        .collect()
}

/// Makes a new image, and shows it.
fn create(name: &str, width: usize, height: usize) -> Vec<u8> {
    let sizes = numbers(&[width, height, CHANNELS.len()]);
    packet(CREATE_IMAGE, true, name, &[&sizes, &channel_names()])
}

/// Updates all of it, in bands of rows.
fn updates(name: &str, rendered: &Rendered) -> impl Iterator<Item = Vec<u8>> {
    let [width, height] = [rendered.image().width(), rendered.image().height()];
    let pixel = CHANNELS.len() * size_of::<f32>();
    let rows = (BAND_BYTES / (width * pixel)).clamp(1, height);
    (0..height).step_by(rows).map(move |first| {
        let band = first * width..(first + rows).min(height) * width;
        let pixels = rendered.image().pixels()[band.clone()].iter();
        let values: Vec<u8> = pixels
            .zip(&rendered.alpha()[band.clone()])
            .flat_map(|(&[r, g, b], &alpha)| [r, g, b, alpha])
            .flat_map(f32::to_le_bytes)
            .collect();
        packet(
            UPDATE_IMAGE,
            false,
            name,
            &[
                &numbers(&[CHANNELS.len()]),
                &channel_names(),
                &numbers(&[0, first, width, band.len() / width]),
                &long_numbers(&[0, 1, 2, 3]),
                &long_numbers(&[CHANNELS.len(); 4]),
                &values,
            ],
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_have_a_host_and_a_port() {
        for (text, host, port) in [
            ("127.0.0.1:14158", "127.0.0.1", 14158),
            ("[::1]:80", "[::1]", 80),
            ("desk:1", "desk", 1),
        ] {
            let host = host.to_owned();
            assert_eq!(Address::parse(text), Ok(Address { host, port }));
        }
        for text in ["", "127.0.0.1", ":80", "::1:80", "desk:", "desk:65536", "a b:80"] {
            assert!(Address::parse(text).is_err(), "{text}");
        }
    }
}
