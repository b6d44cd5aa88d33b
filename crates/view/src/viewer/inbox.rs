//! What other threads have found or made: figures and news of the stage, answers of the picker, files that were opened or written.
//!
//! Goes in: what lies in the mailbox and the channels. Comes out: a viewer that knows it. What always holds: nothing here waits.

use super::{Staged, Viewer, ZoomToCome};
use crate::host::{Opened, Preview};
use crate::jobs::{Finished, JobNumber};
use crate::mailbox::{ModelKey, News};
use crate::navigation::Input;
use crate::picker::{Answer, Purpose};

impl Viewer {
    /// Takes in what other threads have to say.
    pub(super) fn collect(&mut self, now: f64) {
        let delivery = self.mailbox.collect();
        for figures in delivery.figures {
            self.tally.drawn(&figures);
            // Smoothing the last frame's edges is none.
            if figures.samples == 1 {
                self.frame_times.push_back(figures.frame_ms as f32);
            }
            if self.frame_times.len() > 200 {
                self.frame_times.pop_front();
            }
            for problem in &figures.problems {
                if !self.told_problems.contains(problem) {
                    self.told_problems.push(problem.clone());
                    self.notice_error(problem);
                }
            }
            self.figures = figures;
        }
        for news in delivery.news {
            match news {
                News::Picture(name, size, rgba) => self.jobs.write_picture(name, size, rgba),
                News::DeviceLost(why) => self.wants_recovery = Some(why),
                News::Problem(problem) => self.notice_error(&problem),
            }
        }
        while let Ok(answer) = self.answers.try_recv() {
            self.hear(answer, now);
        }
        let previews: Vec<(JobNumber, Preview)> =
            self.jobs.running().iter().filter_map(|job| Some((job.number, job.work.take_preview()?))).collect();
        for (job, Preview { model, points }) in previews {
            self.add(model, job, Some((job, points)));
            self.show_whole();
        }
        for finished in self.jobs.finished() {
            match finished {
                Finished::Opened(job, opened) => {
                    let previews = self.previews_of(job);
                    match *opened {
                        Ok(opened) => self.take(opened, job, !previews.is_empty(), now),
                        Err(error) => self.notice_error(&error),
                    }
                    // Not before the model is there: something is shown all the time.
                    previews.into_iter().for_each(|key| self.remove(key));
                }
                Finished::Cancelled(job, name) => {
                    self.notice(&format!("{name}: cancelled"), now);
                    self.previews_of(job).into_iter().for_each(|key| self.remove(key));
                }
                Finished::Wrote(asked, Ok(path)) => {
                    self.tally.written.push(path.display().to_string());
                    let why = match asked == path {
                        true => String::new(),
                        false => format!(", as {} was there already", asked.display()),
                    };
                    self.notice(&format!("written: {}{why}", path.display()), now);
                }
                Finished::Wrote(_, Err(error)) => self.notice_error(&error),
            }
        }
    }

    fn previews_of(&self, job: JobNumber) -> Vec<ModelKey> {
        let is_of_job = |staged: &&Staged| staged.preview.is_some_and(|(number, _)| number == job);
        self.models.iter().filter(is_of_job).map(|staged| staged.key).collect()
    }

    /// Shows what was opened; from where a person looks at its preview, if there was one.
    fn take(&mut self, opened: Opened, job: JobNumber, had_preview: bool, now: f64) {
        match opened {
            Opened::Model(model) => {
                self.add(model, job, None);
                if had_preview {
                    self.navigation.set_bounds(self.bounds(), self.size);
                } else {
                    self.show_whole();
                }
                self.tell_of_specks(now);
            }
            Opened::Scene(scene) => {
                self.show_scene(scene, job);
                self.tell_of_specks(now);
            }
            Opened::Folder(folder) => self.folder = Some(folder),
            Opened::Path(path) => {
                self.recorder.load(path);
                self.recorder.play(now);
            }
        }
    }

    fn hear(&mut self, answer: Answer, now: f64) {
        match answer {
            Answer::Anchors(anchors) => self.navigation.set_anchors(&anchors, self.size),
            Answer::Problem(problem) => self.notice_error(&problem),
            Answer::Point { purpose: Purpose::Measure(number), found, .. } => {
                if let Some(found) = found {
                    self.navigation.apply(&Input::Anchor(found.anchor()), self.size);
                }
                self.measuring.found(number, found);
            }
            Answer::Point { purpose: Purpose::Pivot, found: Some(found), .. } => {
                self.navigation.apply(&Input::Pivot(found.anchor()), self.size);
            }
            Answer::Point { purpose: Purpose::Zoom, at_px, found } => {
                self.under_cursor = Some((at_px, found.map(|found| found.anchor())));
                if let Some(ZoomToCome { factor, at_px, .. }) = self.zoom_to_come.take() {
                    self.zoom(at_px, factor, now);
                }
            }
            Answer::Point { purpose: Purpose::Ahead, found, .. } => self.ahead = found.map(|found| found.anchor()),
            Answer::Point { .. } => {}
        }
    }
}
