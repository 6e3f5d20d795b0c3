//! `--view`, against a receiver of tev's protocol.

use std::io::Read as _;
use std::net::{TcpListener, TcpStream};
use std::thread::{self, JoinHandle};

use super::{run, stderr, written};

/// What was received about an image.
#[derive(Debug, PartialEq)]
enum Packet {
    Create {
        takes_focus: bool,
        name: String,
        size: [i32; 2],
        channels: Vec<String>,
    },
    /// Rows of all channels.
    Update {
        name: String,
        /// x, y, width, height.
        area: [i32; 4],
        /// For each channel, its values.
        values: Vec<Vec<f32>>,
    },
}

/// Reads fields of a packet.
struct Fields<'a>(&'a [u8]);

impl Fields<'_> {
    fn bytes<const COUNT: usize>(&mut self) -> [u8; COUNT] {
        let (bytes, rest) = self
            .0
            .split_first_chunk()
            .expect("a packet that is as long as its fields");
        self.0 = rest;
        *bytes
    }

    fn int(&mut self) -> i32 {
        i32::from_le_bytes(self.bytes())
    }

    fn long(&mut self) -> usize {
        i64::from_le_bytes(self.bytes()).try_into().expect("an index")
    }

    fn name(&mut self) -> String {
        let end = self.0.iter().position(|byte| *byte == 0).expect("a zero byte");
        let name = String::from_utf8(self.0[..end].to_vec()).expect("UTF-8");
        self.0 = &self.0[end + 1..];
        name
    }

    fn names(&mut self) -> Vec<String> {
        let count = self.int();
        (0..count).map(|_| self.name()).collect()
    }

    fn packet(mut self) -> Packet {
        let [kind, focus] = self.bytes();
        assert!(focus <= 1, "a truth value of {focus}");
        let name = self.name();
        match kind {
            4 => {
                let size = [self.int(), self.int()];
                let channels = self.names();
                assert!(self.0.is_empty(), "{} bytes too many", self.0.len());
                Packet::Create {
                    takes_focus: focus == 1,
                    name,
                    size,
                    channels,
                }
            }
            6 => {
                let channels = self.names().len();
                let area = [self.int(), self.int(), self.int(), self.int()];
                let offsets: Vec<usize> = (0..channels).map(|_| self.long()).collect();
                let strides: Vec<usize> = (0..channels).map(|_| self.long()).collect();
                let data: Vec<f32> = self
                    .0
                    .chunks(4)
                    .map(|value| f32::from_le_bytes(value.try_into().expect("4 bytes")))
                    .collect();
                let pixels = (area[2] * area[3]) as usize;
                let needed = offsets
                    .iter()
                    .zip(&strides)
                    .map(|(offset, stride)| offset + (pixels - 1) * stride + 1)
                    .max();
                assert_eq!(Some(data.len()), needed, "as many values as offsets and strides need");
                let channel = |(offset, stride)| (0..pixels).map(|pixel| data[offset + pixel * stride]).collect();
                Packet::Update {
                    name,
                    area,
                    values: offsets.into_iter().zip(strides).map(channel).collect(),
                }
            }
            other => panic!("a packet of kind {other}"),
        }
    }
}

fn receive(stream: &mut TcpStream) -> Option<Packet> {
    let mut length = [0; 4];
    stream.read_exact(&mut length).ok()?;
    let mut bytes = vec![0; u32::from_le_bytes(length) as usize - 4];
    stream.read_exact(&mut bytes).expect("the packet");
    Some(Fields(&bytes).packet())
}

/// A viewer of one connection: its address, and the packets that it gets.
fn receiver() -> (String, JoinHandle<Vec<Packet>>) {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let packets = thread::spawn(move || {
        let (mut stream, _) = listener.accept().expect("a connection");
        std::iter::from_fn(|| receive(&mut stream)).collect()
    });
    (address, packets)
}

#[test]
fn a_viewer_gets_the_picture_as_it_goes_on_and_the_last_to_the_bit() {
    let (address, receiver) = receiver();
    let folder = tempfile::tempdir().expect("a folder");
    let output = run(folder.path(), &["--time", "3", "--view", &address]);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let packets = receiver.join().expect("packets");
    let create = Packet::Create {
        takes_focus: true,
        name: "o.exr".to_owned(),
        size: [32, 24],
        channels: ["R", "G", "B", "A"].map(str::to_owned).to_vec(),
    };
    assert_eq!(packets[0], create);
    // The first at once, one a second, and the last.
    let updates = &packets[1..];
    assert!((3..=5).contains(&updates.len()), "{} updates in 3 s", updates.len());
    let Some(Packet::Update { name, area, values }) = updates.last() else {
        panic!("no update")
    };
    assert_eq!((name.as_str(), *area), ("o.exr", [0, 0, 32, 24]));
    let picture = written(folder.path());
    for (channel, values) in values[..3].iter().enumerate() {
        let expected: Vec<f32> = picture.pixels().iter().map(|pixel| pixel[channel]).collect();
        assert!(*values == expected, "channel {channel} isn't that of the file");
    }
    assert!(
        values[3].iter().all(|alpha| (0.0..=1.0).contains(alpha)),
        "{:?}",
        values[3]
    );
}

#[test]
fn large_pictures_come_in_bands_that_cover_them() {
    let (address, receiver) = receiver();
    let folder = tempfile::tempdir().expect("a folder");
    let arguments = ["--iterations", "1", "--view", &address, "--resolution", "400x300"];
    let output = run(folder.path(), &arguments);
    assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
    let mut packets = receiver.join().expect("packets");
    let picture = written(folder.path());
    let last = packets.split_off(packets.len() - 2);
    let mut row = 0;
    for packet in last {
        let Packet::Update { area, values, .. } = packet else {
            panic!("{packet:?}")
        };
        assert_eq!([area[0], area[1], area[2]], [0, row, 400]);
        let rows = area[1] as usize * 400..(area[1] + area[3]) as usize * 400;
        let green: Vec<f32> = picture.pixels()[rows].iter().map(|pixel| pixel[1]).collect();
        assert!(values[1] == green, "rows from {row}");
        row += area[3];
    }
    assert_eq!(row, 300, "the last two bands are the last picture");
}

#[test]
fn a_viewer_that_is_missing_or_goes_away_is_one_warning() {
    let listener = TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address").to_string();
    let leaver = thread::spawn(move || drop(listener.accept().expect("a connection")));
    let folder = tempfile::tempdir().expect("a folder");
    for text in ["--view", "there is no viewer"] {
        let output = run(folder.path(), &["--time", "3", "--view", &address]);
        assert_eq!(output.status.code(), Some(0), "{}", stderr(&output));
        let stderr = stderr(&output);
        let warnings: Vec<&str> = stderr.lines().filter(|line| line.starts_with("warning: ")).collect();
        assert_eq!(warnings.len(), 1, "{stderr}");
        assert!(warnings[0].contains(text) && warnings[0].contains(&address), "{stderr}");
        written(folder.path());
    }
    leaver.join().expect("it went away");
}
