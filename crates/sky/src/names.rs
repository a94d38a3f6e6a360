//! Names of enum values, as in configurations, messages and tables.

/// Gives an enum without fields the constant `ALL` and the methods `name` and `from_name`. A call lists every value once, in the order of `ALL`:
///
/// ```ignore
/// named!(ReflectionLaw { Lambert = "lambert", LommelSeeliger = "lommel_seeliger" });
/// ```
#[doc(hidden)]
#[macro_export]
macro_rules! named {
    ($enum:ident { $($value:ident = $name:literal),+ $(,)? }) => {
        impl $enum {
            /// All values.
            pub const ALL: [Self; [$($name),+].len()] = [$(Self::$value),+];

            /// Name in configurations, messages and tables.
            pub const fn name(self) -> &'static str {
                match self {
                    $(Self::$value => $name),+
                }
            }

            /// Value of a name; `None` if the name is unknown.
            pub fn from_name(name: &str) -> Option<Self> {
                Self::ALL.into_iter().find(|value| value.name() == name)
            }
        }
    };
}

#[cfg(test)]
mod tests {
    #[derive(Clone, Copy, Debug, PartialEq)]
    enum Sample {
        First,
        SecondValue,
    }

    named!(Sample { First = "first", SecondValue = "second_value" });

    #[test]
    fn names_and_values_correspond() {
        assert_eq!(Sample::ALL, [Sample::First, Sample::SecondValue]);
        assert_eq!(Sample::ALL.map(Sample::name), ["first", "second_value"]);
        assert_eq!(Sample::from_name("second_value"), Some(Sample::SecondValue));
        assert_eq!(Sample::from_name("SecondValue"), None);
    }
}
