//! A report while it is being written: each part goes into its files and into the text of
//! `README.md`.

use std::collections::BTreeSet;

use super::selected;
use crate::{
    escape,
    report::{
        ClaimsData, CurveData, ReportError, TableData, figure,
        files::Files,
        identity::Identities,
        page::{self, Shows},
        recorded::Run,
        settings::SettingsData,
        statistics::StatisticsData,
        text,
    },
    spec::{Drawing, Figure, Width},
};

/// The name of the files of claims.
const CLAIMS: &str = "claims";
/// The name of the files of summaries over environments.
const STATISTICS: &str = "statistics";
const PROFILE: &str = "statistics-profile";

/// The report so far.
pub struct Draft {
    /// The files written so far.
    pub files: Files,
    /// The text of `README.md` behind its first lines.
    pub body: String,
    /// Characters that the figures' font lacks.
    pub unknown: BTreeSet<char>,
}

impl Draft {
    /// An empty report in these `files`.
    pub fn new(files: Files) -> Self {
        Self {
            files,
            body: String::new(),
            unknown: BTreeSet::new(),
        }
    }

    /// Adds the claims.
    ///
    /// # Errors
    ///
    /// As of all parts: the disk refuses, or a picture or table cannot be encoded.
    pub fn claims(&mut self, data: &ClaimsData) -> Result<(), ReportError> {
        let markdown = text::claims::markdown(data);
        self.table_files(
            CLAIMS,
            &markdown,
            text::claims::latex(CLAIMS, data),
            &text::claims::csv(data)?,
        )
    }

    /// Adds a table of returns.
    ///
    /// # Errors
    ///
    /// As for [`claims`](Self::claims).
    pub fn table(&mut self, name: &str, data: &TableData) -> Result<(), ReportError> {
        self.table_files(
            name,
            &text::markdown(data),
            text::latex(name, data),
            &text::csv(data)?,
        )?;
        Ok(self
            .files
            .write(&format!("{name}-seeds"), "csv", &text::seeds_csv(data)?)?)
    }

    /// Adds a table of settings.
    ///
    /// # Errors
    ///
    /// As for [`claims`](Self::claims).
    pub fn settings(&mut self, name: &str, data: &SettingsData) -> Result<(), ReportError> {
        let markdown = text::settings::markdown(data);
        self.table_files(
            name,
            &markdown,
            text::settings::latex(name, data),
            &text::settings::csv(data)?,
        )
    }

    fn table_files(
        &mut self,
        name: &str,
        markdown: &str,
        latex: [String; 2],
        csv: &[u8],
    ) -> Result<(), ReportError> {
        self.files.table(name, markdown, latex, csv)?;
        self.body.push_str(&format!("\n#{markdown}")); // a table's own heading is one level higher
        Ok(())
    }

    /// Adds `figure` of those of `runs` that it selects; returns the page's version of it.
    ///
    /// # Errors
    ///
    /// As for [`claims`](Self::claims).
    pub fn figure<'a>(
        &mut self,
        figure: &'a Figure,
        runs: &[Run],
        identities: &Identities,
    ) -> Result<page::Figure<'a>, ReportError> {
        let Figure { name, title, .. } = figure;
        let (picture, caption, curves) = match figure.y {
            Drawing::Step => (
                figure::step::draw(figure.width.map(Width::inches))?,
                String::new(),
                None,
            ),
            Drawing::Of(y) => {
                let data =
                    CurveData::new(figure, y, &selected(runs, figure.only.as_ref()), identities);
                self.files
                    .write(&format!("{name}-curves"), "csv", &text::curves_csv(&data)?)?;
                (figure::draw(&data), figure::notes(&data).all(), Some(data))
            }
        };
        self.unknown.extend(picture.without_glyph());
        let svg = self.picture(name, title, &picture)?;
        if figure.width.is_some() {
            self.files
                .write(name, "pdf", &picture.pdf().map_err(ReportError::Draw)?)?;
            // A picture for print does not hold its caption.
            self.body
                .push_str(&format!("\n{}\n", escape::markdown(&caption)));
        }
        let files = figure_files(figure);
        let shows = curves.map_or(Shows::Picture(svg), |data| Shows::Curves(Box::new(data)));
        Ok(page::Figure {
            name,
            title,
            caption,
            files,
            shows,
        })
    }

    /// Adds the summaries over environments; returns the page's version of their figure.
    ///
    /// # Errors
    ///
    /// As for [`claims`](Self::claims).
    pub fn statistics<'a>(
        &mut self,
        data: &'a StatisticsData,
    ) -> Result<page::Figure<'a>, ReportError> {
        let markdown = text::statistics::markdown(data);
        let latex = text::statistics::latex(STATISTICS, data);
        self.table_files(STATISTICS, &markdown, latex, &text::statistics::csv(data)?)?;
        self.files.write(
            &format!("{PROFILE}-curves"),
            "csv",
            &text::curves_csv(&data.profile)?,
        )?;
        self.picture(PROFILE, &data.profile.title, &figure::draw(&data.profile))?;
        Ok(page::Figure {
            name: PROFILE,
            title: &data.profile.title,
            caption: figure::notes(&data.profile).all(),
            files: vec![".png", ".svg", "-curves.csv"],
            shows: Shows::Curves(Box::new(data.profile.clone())),
        })
    }

    /// Adds a picture for the screen; returns it as SVG.
    fn picture(
        &mut self,
        name: &str,
        title: &str,
        picture: &figure::picture::Picture,
    ) -> Result<String, ReportError> {
        let svg = picture.svg().map_err(ReportError::Draw)?;
        self.files
            .write(name, "png", &picture.png().map_err(ReportError::Draw)?)?;
        self.files.write(name, "svg", svg.as_bytes())?;
        let title = escape::markdown(title);
        self.body
            .push_str(&format!("\n## {title}\n\n![{title}]({name}.png)\n"));
        Ok(svg)
    }
}

/// The extensions of the files of `figure`.
fn figure_files(figure: &Figure) -> Vec<&'static str> {
    let (numbers, print) = (figure.y.measure().is_some(), figure.width.is_some());
    let all = [
        (".png", true),
        (".svg", true),
        (".pdf", print),
        ("-curves.csv", numbers),
    ];
    all.into_iter()
        .filter(|(_, has)| *has)
        .map(|(extension, _)| extension)
        .collect()
}
