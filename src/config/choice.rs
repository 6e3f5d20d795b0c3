//! Settings with named values.

use std::fmt;

/// A setting with named values, for programs that offer it.
pub trait Choice: Copy + PartialEq + fmt::Debug + Send + Sync + 'static {
    /// All of them.
    const ALL: &'static [Self];

    /// Its name, in lower case.
    fn name(self) -> &'static str;

    /// Its summary, in a line.
    fn summary(self) -> &'static str;

    /// The value with that name.
    fn named(name: &str) -> Option<Self> {
        Self::ALL.iter().copied().find(|choice| choice.name() == name)
    }
}

/// Declares an enum and makes it a [`Choice`]: each value has one line of documentation, which is its summary, and a name.
macro_rules! choices {
    (
        $(#[$about:meta])*
        pub enum $name:ident {
            $(
                #[doc = $summary:literal]
                $(#[$mark:ident])?
                $value:ident $(= $number:expr)? => $text:literal,
            )+
        }
    ) => {
        $(#[$about])*
        #[derive(Debug, Clone, Copy, PartialEq, Eq)]
        pub enum $name {
            $(
                #[doc = $summary]
                $(#[$mark])?
                $value $(= $number)?,
            )+
        }

        impl $crate::config::Choice for $name {
            const ALL: &'static [Self] = &[$(Self::$value),+];

            fn name(self) -> &'static str {
                match self {
                    $(Self::$value => $text,)+
                }
            }

            fn summary(self) -> &'static str {
                match self {
                    $(Self::$value => $summary.trim_ascii(),)+
                }
            }
        }

        impl std::fmt::Display for $name {
            fn fmt(&self, text: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                text.write_str($crate::config::Choice::name(*self))
            }
        }
    };
}

pub(crate) use choices;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{Accel, Sampler};

    #[test]
    fn values_are_known_by_their_names() {
        for sampler in Sampler::ALL {
            assert_eq!(Sampler::named(sampler.name()), Some(*sampler));
            assert_eq!(sampler.to_string(), sampler.name());
        }
        assert_eq!(Accel::named("magic"), None);
        assert_eq!(Accel::Bvh.summary(), "A bounding volume hierarchy.");
    }
}
