//! Numbers in text, whatever program wrote them.
//!
//! In: a word. Out: the `f64` nearest to what it says. Not a number in any of its spellings is a number, too; the readers
//! decide where they take it.

/// ASCII white space, vertical tab included.
#[inline]
pub(crate) fn is_blank(byte: u8) -> bool {
    byte == b' ' || byte.wrapping_sub(b'\t') < 5
}

/// The number that a word stands for.
#[inline]
pub(crate) fn parse(word: &[u8]) -> Option<f64> {
    let (negative, digits) = match word {
        [b'-', digits @ ..] => (true, digits),
        [b'+', digits @ ..] => (false, digits),
        digits => (false, digits),
    };
    // Integers of up to 15 digits are exact in `f64`. Most of the words of a mesh are vertex numbers.
    if (1..16).contains(&digits.len()) {
        let mut integer = 0;
        for &byte in digits {
            let digit = byte.wrapping_sub(b'0');
            if digit > 9 {
                return parse_real(negative, digits);
            }
            integer = integer * 10 + u64::from(digit);
        }
        let magnitude = integer as f64;
        return Some(if negative { -magnitude } else { magnitude });
    }
    parse_real(negative, digits)
}

fn parse_real(negative: bool, digits: &[u8]) -> Option<f64> {
    let magnitude = match fast_float2::parse::<f64, _>(digits) {
        _ if matches!(digits.first(), Some(b'-' | b'+')) => return None, // A second sign.
        Ok(magnitude) => magnitude,
        Err(_) if is_windows_nan(digits) => f64::NAN,
        Err(_) => return None,
    };
    Some(if negative { -magnitude } else { magnitude })
}

/// `1.#IND`, `1.#QNAN`, `1.#INF00`, `nan(ind)`: how the C library of old Windows compilers writes what is not finite.
fn is_windows_nan(digits: &[u8]) -> bool {
    digits.starts_with(b"1.#") || digits.get(..4).is_some_and(|start| start.eq_ignore_ascii_case(b"nan("))
}

#[cfg(test)]
mod tests {
    use super::parse;

    #[test]
    fn words_are_the_numbers_they_look_like() {
        for (word, number) in [
            ("0", 0.0),
            ("-7", -7.0),
            ("+12", 12.0),
            ("3.0", 3.0),
            ("-.5e-3", -0.0005),
            ("5.", 5.0),
            ("1E4", 1e4),
            ("999999999999999", 999_999_999_999_999.0),
            ("12345678901234567890", 12_345_678_901_234_567_890.0),
            ("0.1000000000000000055511151231257827", 0.1),
            ("1e999", f64::INFINITY),
            ("-Infinity", f64::NEG_INFINITY),
        ] {
            assert_eq!(parse(word.as_bytes()), Some(number), "{word}");
        }
        assert!(parse(b"-0").is_some_and(|zero| zero == 0.0 && zero.is_sign_negative()));
        for word in ["nan", "-NaN", "1.#QNAN", "-1.#IND", "1.#INF00", "-nan(ind)"] {
            assert!(parse(word.as_bytes()).is_some_and(f64::is_nan), "{word}");
        }
        for word in ["", "-", "+", "--1", "+-1", "-+1.5", "1,5", "0x10", "1.2.3", "1e", "e5", ".", "seven"] {
            assert_eq!(parse(word.as_bytes()), None, "{word}");
        }
    }
}
