//! A mistake in a scene for a person at a terminal: message, underlined text and remedy.

use std::fmt;

use bondline::SceneError;
use miette::{Diagnostic, LabeledSpan, NamedSource, SourceCode};

/// The same mistake for a person at a terminal: message, underlined text and remedy.
pub fn report(error: SceneError) -> miette::Report {
    let shown = error.excerpt();
    let source = shown.map(|s| NamedSource::new(&s.name, s.text.clone()));
    let labels = shown.map(|s| {
        let labels = s.labels.iter();
        labels
            .map(|(span, words)| LabeledSpan::at(span.clone(), words.clone()))
            .collect()
    });
    miette::Report::new(Headline {
        error,
        source,
        labels: labels.unwrap_or_default(),
    })
}

/// A [`SceneError`] whose `Display` leaves place and remedy to miette.
#[derive(Debug)]
struct Headline {
    error: SceneError,
    source: Option<NamedSource<String>>,
    labels: Vec<LabeledSpan>,
}

impl fmt::Display for Headline {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.error.message())
    }
}

impl std::error::Error for Headline {}

impl Diagnostic for Headline {
    fn help<'a>(&'a self) -> Option<Box<dyn fmt::Display + 'a>> {
        self.error.remedy().map(|help| Box::new(help) as _)
    }

    fn source_code(&self) -> Option<&dyn SourceCode> {
        let source = self.source.as_ref()?;
        (!self.labels.is_empty()).then_some(source as _)
    }

    fn labels(&self) -> Option<Box<dyn Iterator<Item = LabeledSpan> + '_>> {
        self.source.as_ref()?;
        Some(Box::new(self.labels.iter().cloned()))
    }
}
