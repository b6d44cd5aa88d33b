//! A window that another program destroys, as `xdotool windowclose` does.
//!
//! winit asks the X server about its window and takes for granted that it is there: between its end and the server's news of that,
//! it panics. Such a panic is told apart by its message, kept quiet and caught, so that what is being written still gets to disk. Others
//! go on as they would.

use std::any::Any;
use std::panic::{self, AssertUnwindSafe};

/// The window was destroyed.
#[derive(Debug)]
pub(crate) struct Forced;

/// What `events` returns, or that it ended because its window did. For the first thread, once: the panic hook stays.
pub(crate) fn unless_forced<T>(events: impl FnOnce() -> T) -> Result<T, Forced> {
    let usual = panic::take_hook();
    panic::set_hook(Box::new(move |info| {
        if !is_of_a_destroyed_window(info.payload()) {
            usual(info);
        }
    }));
    panic::catch_unwind(AssertUnwindSafe(events)).map_err(|payload| {
        if !is_of_a_destroyed_window(&*payload) {
            panic::resume_unwind(payload);
        }
        Forced
    })
}

/// The errors of X's protocol that name no window or drawable, as x11rb and Xlib spell them.
fn is_of_a_destroyed_window(payload: &(dyn Any + Send)) -> bool {
    let text = payload.downcast_ref::<String>().map(String::as_str).or(payload.downcast_ref::<&str>().copied());
    let names = ["error_kind: Window", "error_kind: Drawable", "BadWindow", "BadDrawable"];
    text.is_some_and(|text| names.iter().any(|name| text.contains(name)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_for_want_of_the_window_is_told_apart_from_others() {
        let message =
            "called `Result::unwrap()` on an `Err` value: X11(X11Error { error_kind: Window, error_code: 3 })";
        assert!(unless_forced(|| panic!("{message}")).is_err());
        assert_eq!(unless_forced(|| 7).unwrap(), 7);
        let other = panic::catch_unwind(|| unless_forced(|| panic!("a window of opportunity")));
        assert_eq!(other.unwrap_err().downcast_ref::<&str>(), Some(&"a window of opportunity"));
    }
}
