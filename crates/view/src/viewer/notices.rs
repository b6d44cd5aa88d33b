//! What a person is told over the picture: the newest piece of news, and errors until they are closed.

use super::Viewer;

/// Something to tell a person.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Notice {
    pub(crate) text: String,
    pub(crate) is_error: bool,
    /// Seconds of egui's clock at which it goes by itself; errors stay.
    pub(crate) until: f64,
}

impl Viewer {
    /// Tells news, in the place of older news.
    pub(crate) fn notice(&mut self, text: &str, now: f64) {
        self.notices.retain(|notice| notice.is_error);
        self.notices.push(Notice { text: text.to_string(), is_error: false, until: now + 6.0 });
    }

    /// Tells of something that went wrong and was put right.
    pub(crate) fn notice_mended(&mut self, text: &str, now: f64) {
        self.tally.problems.push(text.to_string());
        self.notice(text, now);
    }

    /// Tells an error, once as long as it is shown.
    pub(crate) fn notice_error(&mut self, text: &str) {
        if self.notices.iter().any(|notice| notice.text == text) {
            return;
        }
        self.tally.problems.push(text.to_string());
        self.notices.push(Notice { text: text.to_string(), is_error: true, until: f64::INFINITY });
    }
}
