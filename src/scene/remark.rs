//! Remarks about a scene for the user.

use std::fmt;
use std::ops::Deref;

use crate::error::one_line;

/// A remark about a scene for the user, in one line. It names no flags of a program; [`Remark::choice`] is the option that
/// changes it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Remark {
    text: String,
    choice: Option<LoadChoice>,
}

/// The field of [`LoadOptions`](crate::loader::LoadOptions) that changes a decision.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum LoadChoice {
    /// [`LoadOptions::frame_time`](crate::loader::LoadOptions::frame_time).
    FrameTime,
    /// [`LoadOptions::environment`](crate::loader::LoadOptions::environment).
    Environment,
    /// [`LoadOptions::scene`](crate::loader::LoadOptions::scene).
    Scene,
    /// [`LoadOptions::light_units`](crate::loader::LoadOptions::light_units).
    LightUnits,
    /// [`LoadOptions::solid_glass`](crate::loader::LoadOptions::solid_glass).
    SolidGlass,
}

impl Remark {
    /// A remark about a decision that an option changes.
    pub(crate) fn with(choice: LoadChoice, text: impl Into<String>) -> Self {
        Self {
            text: one_line(text.into()),
            choice: Some(choice),
        }
    }

    /// The line.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// The option that changes it.
    pub fn choice(&self) -> Option<LoadChoice> {
        self.choice
    }
}

impl From<String> for Remark {
    fn from(text: String) -> Self {
        Self {
            text: one_line(text),
            choice: None,
        }
    }
}

impl Deref for Remark {
    type Target = str;

    fn deref(&self) -> &str {
        &self.text
    }
}

impl PartialEq<&str> for Remark {
    fn eq(&self, text: &&str) -> bool {
        self.text == *text
    }
}

impl fmt::Display for Remark {
    fn fmt(&self, text: &mut fmt::Formatter<'_>) -> fmt::Result {
        text.write_str(&self.text)
    }
}
