//! A cache of compiled pipelines in the user's cache folder, so that a driver compiles each kernel once and not in every run. The
//! cache is optional: without a folder, or if it can't be read or written, kernels are compiled again.

use std::fs;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};

use ash::vk;

use super::context::{Context, OrVulkan};
use crate::error::Result;
use crate::files::{self, Writing};

/// Larger files were not written by this program.
const MOST_BYTES: u64 = 256 << 20;
/// Size of the checksum before the driver's data, in bytes.
const CHECKSUM: usize = 8;

/// A driver's cache and its file.
pub(super) struct PipelineCache {
    pub handle: vk::PipelineCache,
    file: Option<PathBuf>,
    /// Content of the file, which need not be written again.
    known: Vec<u8>,
}

impl PipelineCache {
    /// Opens the cache of a device; an empty one if the file is missing, damaged, or of another driver.
    pub fn open(context: &Context, physical: vk::PhysicalDevice) -> Result<Self> {
        // SAFETY: the physical device belongs to the context's instance.
        let properties = unsafe { context.instance.handle.get_physical_device_properties(physical) };
        let file = folder().map(|folder| {
            let uuid: String = properties
                .pipeline_cache_uuid
                .iter()
                .map(|byte| format!("{byte:02x}"))
                .collect();
            folder.join(format!("pipelines-{:08x}-{uuid}.bin", properties.driver_version))
        });
        let known = file.as_deref().and_then(read).unwrap_or_default();
        let known = if is_of(&known, &properties) { known } else { Vec::new() };
        let make = |known: &[u8]| {
            let create = vk::PipelineCacheCreateInfo::default().initial_data(known);
            // SAFETY: a plain creation call; `free` destroys what it makes.
            unsafe { context.device.create_pipeline_cache(&create, None) }
        };
        let handle = make(&known).or_else(|_| make(&[])).or_vulkan("vkCreatePipelineCache")?;
        context.name(handle, "pipelines");
        Ok(Self { handle, file, known })
    }

    /// An empty cache that is not saved.
    pub fn empty(context: &Context) -> Result<Self> {
        let create = vk::PipelineCacheCreateInfo::default();
        // SAFETY: a plain creation call; `free` destroys what it makes.
        let handle =
            unsafe { context.device.create_pipeline_cache(&create, None) }.or_vulkan("vkCreatePipelineCache")?;
        Ok(Self {
            handle,
            file: None,
            known: Vec::new(),
        })
    }

    /// Saves new content, and destroys the cache.
    pub fn free(&mut self, context: &Context) {
        // SAFETY: the caller makes no more pipelines with it.
        let data = unsafe { context.device.get_pipeline_cache_data(self.handle) };
        if let (Ok(data), Some(file)) = (data, &self.file)
            && data != self.known
        {
            // Another process may use the same file, so it is replaced atomically.
            let _ = write(file, &data);
        }
        // SAFETY: as above.
        unsafe { context.device.destroy_pipeline_cache(self.handle, None) };
    }
}

fn folder() -> Option<PathBuf> {
    let variable = |name| {
        std::env::var_os(name)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
    };
    let cache = variable("XDG_CACHE_HOME").or_else(|| variable("LOCALAPPDATA"));
    let cache = cache.or_else(|| variable("HOME").map(|home| home.join(".cache")));
    // The XDG base directory specification: a relative one is to be ignored.
    cache
        .filter(|cache| cache.is_absolute())
        .map(|cache| cache.join("ppm-vk"))
}

/// FNV-1a: detects a file that was truncated or changed.
fn checksum(bytes: &[u8]) -> [u8; CHECKSUM] {
    let hash = bytes.iter().fold(0xcbf2_9ce4_8422_2325_u64, |hash, &byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    hash.to_le_bytes()
}

/// The driver's part of a file, if the file is intact.
fn read(file: &Path) -> Option<Vec<u8>> {
    let opened = files::open(file).ok()?;
    if opened.metadata().ok()?.len() > MOST_BYTES {
        return None;
    }
    let mut bytes = Vec::new();
    opened.take(MOST_BYTES).read_to_end(&mut bytes).ok()?;
    let (sum, data) = bytes.split_at_checked(CHECKSUM)?;
    if checksum(data) != sum {
        return None;
    }
    bytes.drain(..CHECKSUM);
    Some(bytes)
}

fn write(file: &Path, data: &[u8]) -> std::io::Result<()> {
    let folder = file.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder)?;
    let _writing = Writing::begin();
    let mut temporary = tempfile::NamedTempFile::new_in(folder)?;
    temporary.write_all(&checksum(data))?;
    temporary.write_all(data)?;
    temporary.persist(file)?;
    Ok(())
}

/// Whether a cache was made by this device and driver: VkPipelineCacheHeaderVersionOne.
fn is_of(data: &[u8], properties: &vk::PhysicalDeviceProperties) -> bool {
    let word = |at: usize| {
        data.get(at..at + 4)
            .map(|bytes| u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    };
    word(0).is_some_and(|size| size >= 32)
        && word(4) == Some(vk::PipelineCacheHeaderVersion::ONE.as_raw() as u32)
        && word(8) == Some(properties.vendor_id)
        && word(12) == Some(properties.device_id)
        && data.get(16..32) == Some(&properties.pipeline_cache_uuid[..])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_that_was_cut_or_changed_is_not_used() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("deep/pipelines.bin");
        write(&file, b"what a driver wrote").expect("a file");
        assert_eq!(read(&file).as_deref(), Some(&b"what a driver wrote"[..]));
        let mut bytes = fs::read(&file).expect("the file");
        bytes.pop();
        fs::write(&file, &bytes).expect("a shorter file");
        assert_eq!(read(&file), None);
        fs::write(&file, b"short").expect("a short file");
        assert_eq!(read(&file), None);
        assert_eq!(read(&folder.path().join("absent")), None);
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_in_its_place_is_not_waited_for() {
        let folder = tempfile::tempdir().expect("a folder");
        let pipe = folder.path().join("pipelines.bin");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.expect("mkfifo").success());
        assert_eq!(read(&pipe), None);
    }

    #[test]
    fn a_cache_of_another_driver_is_not_used() {
        let properties = vk::PhysicalDeviceProperties {
            vendor_id: 1,
            device_id: 2,
            pipeline_cache_uuid: [3; 16],
            ..Default::default()
        };
        let header = |device: u32, uuid: u8| {
            let words = [32u32, 1, 1, device].map(u32::to_le_bytes);
            [words.as_flattened(), &[uuid; 16], b"data"].concat()
        };
        assert!(is_of(&header(2, 3), &properties));
        assert!(!is_of(&header(7, 3), &properties));
        assert!(!is_of(&header(2, 4), &properties));
        assert!(!is_of(&header(2, 3)[..20], &properties));
        assert!(!is_of(&[], &properties));
    }
}
