//! Tables for LaTeX: a bare `tabular` for a float of the user's own, and a complete float.
//!
//! Owns what TeX needs: escapes, booktabs' rules, numbers aligned at their `±`. Knows nothing of
//! where the numbers come from. Start at [`tabular`] and [`float`]. Both need the package booktabs;
//! the float needs graphicx too.

use super::Grid;
use crate::escape;

const PLUS_MINUS: &str = " ± ";

/// The grid as a bare `tabular`.
pub fn tabular(grid: &Grid) -> String {
    format!("% needs \\usepackage{{booktabs}}\n{}", bare(grid))
}

/// A float with the grid, its caption with the label `tab:NAME`, and its notes below. A grid wider
/// than the line is set in smaller type, and scaled down if that is not enough, so that no line is
/// overfull whatever the class.
pub fn float(name: &str, title: &str, notes: &[String], grid: &Grid) -> String {
    let (caption, bare) = (escape::latex(unnumbered(title)), bare(grid));
    let notes: String = notes
        .iter()
        .map(|note| format!("{}\n", escape::latex(note)))
        .collect();
    let smaller = [("small", 5), ("footnotesize", 4), ("scriptsize", 3)].map(|(size, gap)| {
        let set =
            format!("\\setbox0\\hbox{{\\{size}\\setlength\\tabcolsep{{{gap}pt}}\\mcporuntable}}");
        format!("\\ifdim\\wd0>\\linewidth{set}\\fi\n")
    });
    format!(
        "% needs \\usepackage{{booktabs,graphicx}}\n\
         \\begin{{table}}\n\\centering\n\\caption{{{caption}}}\n\\label{{tab:{name}}}\n\
         \\begingroup % in the largest type in which it fits into its line\n\
         \\def\\mcporuntable{{%\n{bare}}}%\n\
         \\setbox0\\hbox{{\\mcporuntable}}%\n{smaller}\
         \\ifdim\\wd0>\\linewidth\\resizebox{{\\linewidth}}{{!}}{{\\box0}}\
         \\else\\leavevmode\\box0\\fi\\par\n\
         \\endgroup\n\
         \\smallskip\n\\begin{{minipage}}{{\\linewidth}}\\footnotesize\\raggedright\n\
         {notes}\\end{{minipage}}\n\
         \\end{{table}}\n",
        smaller = smaller.concat(),
    )
}

/// `title` without a leading number such as `Table 3:`, since LaTeX numbers tables itself.
fn unnumbered(title: &str) -> &str {
    match title.split_once(": ") {
        Some((number, rest)) if number.starts_with("Table ") => rest,
        _ => title,
    }
}

/// The bare table. Each column of numbers with a deviation is split in two, so that the numbers are
/// aligned at their `±`.
fn bare(grid: &Grid) -> String {
    let column = |index: usize| grid.rows.iter().map(move |row| row[index].as_str());
    let split: Vec<bool> = (0..grid.headers.len())
        .map(|index| grid.numeric[index] && column(index).any(|cell| cell.contains(PLUS_MINUS)))
        .collect();
    let kinds = split
        .iter()
        .zip(&grid.numeric)
        .map(|(split, numeric)| match (split, numeric) {
            (true, _) => "r@{}l",
            (false, true) => "r",
            (false, false) => "l",
        });
    let alignment: String = kinds.collect();
    let headers: Vec<String> = grid
        .headers
        .iter()
        .zip(&split)
        .map(|(header, split)| match split {
            true => format!("\\multicolumn{{2}}{{c}}{{{}}}", escape::latex(header)),
            false => escape::latex(header),
        })
        .collect();
    let mut text = format!(
        "\\begin{{tabular}}{{{alignment}}}\n\\toprule\n{} \\\\\n\\midrule\n",
        headers.join(" & ")
    );
    for row in &grid.rows {
        let cells: Vec<String> = row
            .iter()
            .zip(&split)
            .map(|(cell, split)| cell_of(cell, *split))
            .collect();
        text.push_str(&format!("{} \\\\\n", cells.join(" & ")));
    }
    text.push_str("\\bottomrule\n\\end{tabular}\n");
    text
}

/// One cell. In a split column, the part before its `±` or before a remark, and then the rest.
fn cell_of(cell: &str, split: bool) -> String {
    if !split {
        return escape::latex(cell);
    }
    match (cell.split_once(PLUS_MINUS), cell.split_once(" (")) {
        (Some((mean, rest)), _) => format!(
            "{} & ${{}}\\pm{{}}${}",
            escape::latex(mean),
            escape::latex(rest)
        ),
        (None, Some((number, remark))) => {
            format!("{} & ~({}", escape::latex(number), escape::latex(remark))
        }
        (None, None) => format!("{} &", escape::latex(cell)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn grid() -> Grid {
        let row = |cells: [&str; 4]| cells.map(str::to_owned).to_vec();
        Grid {
            headers: row(["ε & d", "MCPO", "n", "verdict"]),
            rows: vec![
                row(["10⁻³", "1802 ± 13", "5", "consistent"]),
                row(["[8]", "−2.5 (1 of 2 seeds)", "1", "50 % less"]),
                row(["", "", "", ""]),
            ],
            names: 1,
            numeric: vec![false, true, true, false],
        }
    }

    #[test]
    fn numbers_stand_at_their_plus_minus_and_text_is_escaped() {
        let expected = "\
% needs \\usepackage{booktabs}
\\begin{tabular}{lr@{}lrl}
\\toprule
$\\epsilon$ \\& d & \\multicolumn{2}{c}{MCPO} & n & verdict \\\\
\\midrule
10$^{-3}$ & 1802 & ${}\\pm{}$13 & 5 & consistent \\\\
{[}8{]} & $-$2.5 & ~(1 of 2 seeds) & 1 & 50 \\% less \\\\
 &  & &  &  \\\\
\\bottomrule
\\end{tabular}
";
        assert_eq!(tabular(&grid()), expected);
    }

    #[test]
    fn a_float_has_its_label_and_its_notes_below() {
        let text = float(
            "table-3",
            "Table 3: 50 % & more",
            &["n = 5 seeds.".to_owned()],
            &grid(),
        );
        assert!(
            text.contains("\\caption{50 \\% \\& more}\n\\label{tab:table-3}"),
            "{text}"
        );
        assert!(
            text.contains("\\raggedright\nn = 5 seeds.\n\\end{minipage}"),
            "{text}"
        );
        let (table, end) = (
            text.find("\\bottomrule").expect("a table"),
            text.find("n = 5").expect("a note"),
        );
        assert!(table < end);
    }
}
