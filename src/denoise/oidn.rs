//! The C API of Open Image Denoise 2, as far as it is used. Its library is loaded at run time, so that the program runs without.

use std::ffi::{CStr, CString, c_char, c_int, c_void};
use std::mem;
use std::path::Path;
use std::ptr;

use libloading::Library;

use crate::error::{Error, Remedy, Result, one_line};
use crate::film::Image;

/// The library's name where the system looks for libraries.
const LIBRARY: &str = if cfg!(windows) {
    "OpenImageDenoise.dll"
} else if cfg!(target_os = "macos") {
    "libOpenImageDenoise.2.dylib"
} else {
    "libOpenImageDenoise.so.2"
};
/// The version whose API this is.
const MAJOR: c_int = 2;

// Constants of its header.
const DEVICE_CPU: c_int = 1;
const FORMAT_FLOAT3: c_int = 3;

/// A pointer to one of the library's objects.
type Handle = *mut c_void;

/// Declares the functions that are used, and how they are loaded.
macro_rules! functions {
    ($($field:ident = $name:literal: fn($($argument:ty),*) $(-> $result:ty)?;)*) => {
        struct Functions {
            $($field: unsafe extern "C" fn($($argument),*) $(-> $result)?,)*
        }

        impl Functions {
            /// # Safety
            /// Functions of these names have these types, as in Open Image Denoise 2.
            unsafe fn of(library: &Library) -> std::result::Result<Self, libloading::Error> {
                Ok(Self {
                    // SAFETY: the caller's promise.
                    $($field: unsafe { *library.get(concat!($name, "\0").as_bytes())? },)*
                })
            }
        }
    };
}

functions! {
    new_device = "oidnNewDevice": fn(c_int) -> Handle;
    set_device_int = "oidnSetDeviceInt": fn(Handle, *const c_char, c_int);
    set_device_bool = "oidnSetDeviceBool": fn(Handle, *const c_char, bool);
    get_device_int = "oidnGetDeviceInt": fn(Handle, *const c_char) -> c_int;
    commit_device = "oidnCommitDevice": fn(Handle);
    get_device_error = "oidnGetDeviceError": fn(Handle, *mut *const c_char) -> c_int;
    release_device = "oidnReleaseDevice": fn(Handle);
    new_filter = "oidnNewFilter": fn(Handle, *const c_char) -> Handle;
    set_filter_image = "oidnSetSharedFilterImage": fn(Handle, *const c_char, *mut c_void, c_int, usize, usize, usize, usize, usize);
    set_filter_bool = "oidnSetFilterBool": fn(Handle, *const c_char, bool);
    commit_filter = "oidnCommitFilter": fn(Handle);
    execute_filter = "oidnExecuteFilter": fn(Handle);
    release_filter = "oidnReleaseFilter": fn(Handle);
}

/// What is filtered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Kind {
    /// Radiance, which may be of any brightness.
    Radiance {
        /// Whether its guides are filtered already.
        clean_guides: bool,
    },
    /// A guide.
    Guide,
}

/// Its CPU device: GPUs would give other bits.
pub(super) struct Device {
    functions: Functions,
    handle: Handle,
}

impl Device {
    /// Loads the library, with as many threads as the program's.
    pub fn open(file: Option<&Path>) -> Result<Self> {
        let name = file.unwrap_or(LIBRARY.as_ref());
        let unfit = |what: String| Error::unfit(format!("{}: {what}", name.display()), Remedy::InstallDenoiser);
        let is_there = file.is_none_or(Path::is_file);
        if !is_there {
            return Err(unfit("there is no such file".to_owned()));
        }
        // SAFETY: loading runs the library's initialisers. It is named by the user, or is what the system has by this name.
        let library = unsafe { Library::new(name) };
        let library = library.map_err(|error| unfit(format!("can't be loaded as Open Image Denoise ({error})")))?;
        // SAFETY: a library with all of these names is Open Image Denoise 2 (some of them are not in version 1); its header
        // declares them as above.
        let functions = unsafe { Functions::of(&library) };
        let functions = functions.map_err(|error| unfit(format!("is not Open Image Denoise {MAJOR} ({error})")))?;
        // Never unloaded: its worker threads may still be in its code after the last call.
        mem::forget(library);
        // SAFETY: the type is one of its header's.
        let handle = unsafe { (functions.new_device)(DEVICE_CPU) };
        let device = Self { functions, handle };
        if device.handle.is_null() {
            let why = device.check().err().map_or(String::new(), |why| format!(" ({why})"));
            return Err(unfit(format!("can't use this CPU{why}")));
        }
        let version = device.version();
        if version[0] != MAJOR {
            let [major, minor, patch] = version;
            return Err(unfit(format!("is version {major}.{minor}.{patch}, not {MAJOR}")));
        }
        let threads = c_int::try_from(rayon::current_num_threads()).unwrap_or(c_int::MAX);
        // SAFETY: the device is alive, and the names end with 0. Threads are not bound to cores: other programs run there too.
        unsafe {
            (device.functions.set_device_int)(device.handle, c"numThreads".as_ptr(), threads);
            (device.functions.set_device_bool)(device.handle, c"setAffinity".as_ptr(), false);
            (device.functions.commit_device)(device.handle);
        }
        device.check().map_err(|why| unfit(format!("can't be used ({why})")))?;
        Ok(device)
    }

    /// Major, minor, patch.
    pub fn version(&self) -> [c_int; 3] {
        [c"versionMajor", c"versionMinor", c"versionPatch"].map(|name| {
            // SAFETY: the device is alive, and the name ends with 0.
            unsafe { (self.functions.get_device_int)(self.handle, name.as_ptr()) }
        })
    }

    /// Filters the first of the named pictures, with the others as guides. All have the same size.
    pub fn filter(&self, inputs: &[(&str, &Image)], kind: Kind) -> Result<Image> {
        let [width, height] = [inputs[0].1.width(), inputs[0].1.height()];
        let mut output = vec![[0.0f32; 3]; width * height];
        let flag = |filter: Handle, name: &CStr| {
            // SAFETY: the filter is alive, and the name ends with 0.
            unsafe { (self.functions.set_filter_bool)(filter, name.as_ptr(), true) };
        };
        let image = |filter: Handle, name: &str, pixels: *mut c_void| {
            let name = CString::new(name).expect("a name without 0");
            let functions = &self.functions;
            // SAFETY: `pixels` has width · height pixels of three floats without gaps (strides of 0), which live until the filter
            // is released. The filter writes those of the output only.
            unsafe {
                (functions.set_filter_image)(filter, name.as_ptr(), pixels, FORMAT_FLOAT3, width, height, 0, 0, 0)
            };
        };
        // SAFETY: the device is alive, and the name ends with 0.
        let filter = unsafe { (self.functions.new_filter)(self.handle, c"RT".as_ptr()) };
        if !filter.is_null() {
            for (name, input) in inputs {
                assert_eq!(input.pixels().len(), output.len(), "{name} has another size");
                image(filter, name, input.pixels().as_ptr().cast_mut().cast());
            }
            image(filter, "output", output.as_mut_ptr().cast());
            if let Kind::Radiance { clean_guides } = kind {
                flag(filter, c"hdr");
                if clean_guides {
                    flag(filter, c"cleanAux");
                }
            }
            // SAFETY: the filter is alive. It is executed before the call returns, and released once.
            unsafe {
                (self.functions.commit_filter)(filter);
                (self.functions.execute_filter)(filter);
                (self.functions.release_filter)(filter);
            }
        }
        let failed = |why| Error::Device(one_line(format!("Open Image Denoise failed: {why}")));
        self.check().map_err(failed)?;
        Ok(Image::new(width, height, output))
    }

    /// The first error since the last call, as the library words it. It forgets it.
    fn check(&self) -> std::result::Result<(), String> {
        let mut message = ptr::null();
        // SAFETY: the device is alive, or null, which stands for errors without one.
        let code = unsafe { (self.functions.get_device_error)(self.handle, &raw mut message) };
        if code == 0 {
            return Ok(());
        }
        if message.is_null() {
            return Err(format!("error {code}"));
        }
        // SAFETY: it ends with 0, and lives until the next call on this thread.
        Err(unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned())
    }
}

impl Drop for Device {
    fn drop(&mut self) {
        if !self.handle.is_null() {
            // SAFETY: the device is alive, and used no more.
            unsafe { (self.functions.release_device)(self.handle) };
        }
    }
}
