//! Text for terminals and messages.

use std::fmt::Write as _;

/// `text` with control characters escaped as in JSON (`\u001b`): those that move a terminal's cursor, change its state or the
/// direction of writing. Names in files may contain such characters, and names of files and of devices.
pub fn escaped(text: &str) -> String {
    escape(text, false)
}

/// The same, but line ends are kept.
pub fn escaped_lines(text: &str) -> String {
    escape(text, true)
}

fn escape(text: &str, keeps_lines: bool) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        if (character == '\n' && keeps_lines) || !is_hidden(character) {
            escaped.push(character);
        } else {
            // All of them have 16 bits, and writing to a String can't fail.
            let _ = write!(escaped, "\\u{:04x}", u32::from(character));
        }
    }
    escaped
}

/// Controls of C0 and C1, line and paragraph separators, and Unicode's marks, embeddings, overrides and isolates of directions.
fn is_hidden(character: char) -> bool {
    character.is_control()
        || matches!(character, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// Maximum number of items in a list of a message.
const MAX_LISTED: usize = 8;

/// Maximum number of characters of a name or URI in a message: a file may contain megabytes of them, and repeat them per
/// instance.
const MAX_NAME: usize = 120;

/// `name`, truncated if it is longer than any sensible name.
pub(crate) fn shorten(name: &str) -> String {
    match name.char_indices().nth(MAX_NAME) {
        Some((end, _)) => format!("{}…", &name[..end]),
        None => name.to_owned(),
    }
}

/// `name` in quotation marks, with line ends and control characters escaped.
pub(crate) fn quote(name: &str) -> String {
    format!("{:?}", shorten(name))
}

/// `a, b and c`, or the first few `and 5 more`.
pub(crate) fn list(items: &[String]) -> String {
    let (shown, rest) = items.split_at(items.len().min(MAX_LISTED));
    match (shown, rest.len()) {
        ([head @ .., last], 0) if !head.is_empty() => format!("{} and {last}", head.join(", ")),
        (shown, 0) => shown.join(", "),
        (shown, more) => format!("{} and {more} more", shown.join(", ")),
    }
}

/// A number of bytes with about three digits: a positive number is never shown as 0.
pub fn bytes(count: u64) -> String {
    match count {
        0..1024 => format!("{count} bytes"),
        1024..0x10_0000 => format!("{:.1} KiB", count as f64 / 1024.0),
        0x10_0000..0x4000_0000 => format!("{:.1} MiB", count as f64 / f64::from(1 << 20)),
        _ => format!("{:.1} GiB", count as f64 / f64::from(1 << 30)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_terminals_obey_is_spelt_out() {
        let name = "a\u{1b}[31m\r\n\u{9b}2J\u{202e}b\u{2066}\u{7f}";
        assert_eq!(escaped(name), r"a\u001b[31m\u000d\u000a\u009b2J\u202eb\u2066\u007f");
        assert_eq!(escaped_lines("a\nb\tc"), "a\nb\\u0009c");
        let plain = "Tür «1» 日本 🙂 👩‍🚀";
        assert_eq!(escaped(plain), plain);
        // JSON stays JSON.
        let json = escaped_lines("{\n\"name\": \"\u{202e}\"}");
        assert!(serde_json::from_str::<serde_json::Value>(&json).is_ok_and(|value| value["name"] == "\u{202e}"));
    }

    #[test]
    fn no_number_of_bytes_is_told_as_none() {
        let texts = [1, 1023, 1024, 300_000, 3 << 19, 5 << 30].map(bytes);
        assert_eq!(
            texts,
            ["1 bytes", "1023 bytes", "1.0 KiB", "293.0 KiB", "1.5 MiB", "5.0 GiB"]
        );
    }
}
