//! Tests that the commands in the documents parse, and that their files and links exist.

use std::fs;
use std::path::{Path, PathBuf};

use clap::Command;

use crate::{check_arguments, whole};

/// Returns the documents, with the base folder of their links.
fn documents() -> Vec<(PathBuf, String)> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut paths: Vec<PathBuf> =
        ["README.md", "ARCHITECTURE.md", "DESIGN.md", "COMPARE.md", "CONTRIBUTING.md", "CHANGELOG.md"]
            .map(|name| root.join(name))
            .into();
    for folder in ["docs", "scenarios", "recordings"] {
        let entries = fs::read_dir(root.join(folder)).unwrap().map(|entry| entry.unwrap().path());
        paths.extend(entries.filter(|path| path.extension().is_some_and(|extension| extension == "md")));
    }
    paths.into_iter().map(|path| (path.clone(), fs::read_to_string(&path).unwrap())).collect()
}

/// Returns the lines of the fenced blocks of shell commands.
fn shell_lines(text: &str) -> impl Iterator<Item = &str> {
    let blocks = text.split("```").skip(1).step_by(2);
    blocks.filter_map(|block| block.strip_prefix("sh\n")).flat_map(str::lines)
}

/// Returns the arguments of the program, if the line of shell calls it.
fn arguments(line: &str) -> Option<&str> {
    let command = line.split(" && ").last().unwrap_or(line);
    ["resonarm ", "cargo run --release -- "].iter().find_map(|program| command.strip_prefix(program))
}

/// Returns the words of a line of shell: what is between quotes, of either kind, is one word.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote): (Vec<String>, Option<String>, Option<char>) = (vec![], None, None);
    for letter in line.chars() {
        match quote {
            Some(closing) if letter == closing => quote = None,
            None if letter == '"' || letter == '\'' => {
                quote = Some(letter);
                word.get_or_insert_default();
            }
            None if letter.is_whitespace() => words.extend(word.take()),
            _ => word.get_or_insert_default().push(letter),
        }
    }
    words.extend(word);
    words
}

#[test]
fn every_command_in_the_documents_is_valid() {
    let mut commands = 0;
    for (path, text) in documents() {
        for line in shell_lines(&text) {
            let Some(arguments) = arguments(line) else { continue };
            if let Err(message) = check_arguments(words(arguments).iter().map(String::as_str)) {
                panic!("{}: {line}\n{message}", path.display());
            }
            commands += 1;
        }
    }
    assert!(commands >= 12, "only {commands} commands found");
}

/// What `quickstart` writes is read as text: its commands are indented lines, or words between backticks.
#[test]
fn every_command_of_a_quickstart_is_valid() {
    let text = include_str!("../examples/quickstart/README.md");
    let indented = text.lines().filter_map(|line| line.strip_prefix("    resonarm "));
    let within = text.split('`').skip(1).step_by(2).filter_map(|code| code.strip_prefix("resonarm "));
    let commands: Vec<&str> = indented.chain(within.filter(|words| words.contains(" --"))).collect();
    assert!(commands.len() >= 7, "{commands:?}");
    for command in commands {
        assert_eq!(check_arguments(command.split_whitespace()), Ok(()), "{command}");
    }
}

/// Returns the texts after the help of a command and of those below it.
fn after_help(command: &Command) -> Vec<String> {
    let own = [command.get_after_help(), command.get_after_long_help()];
    let own = own.into_iter().flatten().map(ToString::to_string);
    own.chain(command.get_subcommands().flat_map(after_help)).collect()
}

/// An example is a line that begins with the program's name, and those that continue it after a backslash. A terminal
/// of 80 columns breaks none of them.
#[test]
fn every_example_in_a_help_is_valid_and_stays_whole() {
    let mut examples = 0;
    for text in after_help(&whole()) {
        let mut lines = text.lines();
        while let Some(line) = lines.next() {
            if !line.trim_start().starts_with("resonarm ") {
                continue;
            }
            let mut command = String::new();
            for part in core::iter::once(line).chain(lines.by_ref()) {
                assert!(part.chars().count() <= 80, "{part}");
                command += part.trim_end_matches('\\');
                if !part.ends_with('\\') {
                    break;
                }
            }
            assert_eq!(check_arguments(words(&command).iter().map(String::as_str).skip(1)), Ok(()), "{command}");
            examples += 1;
        }
    }
    assert!(examples >= 30, "only {examples} examples found");
}

#[test]
fn every_scenario_and_recording_that_a_command_names_is_there() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    for (path, text) in documents() {
        for word in shell_lines(&text).flat_map(str::split_whitespace) {
            if word.starts_with("scenarios/") || word.starts_with("recordings/") {
                assert!(root.join(word).exists(), "{}: {word}", path.display());
            }
        }
    }
}

/// The flags whose value is the name, or its beginning, of a file that a command writes.
const WRITE: [&str; 6] = ["--record", "--plot", "--out", "--angles", "--junit", "--report"];
/// The commands whose second file is written.
const COPY: [&str; 3] = ["cut", "import", "recover"];
/// The endings of files that commands read.
const READ: [&str; 7] = [".mcap", ".toml", ".json", ".log", ".asc", ".blf", ".csv"];

/// Returns the files that a command line reads and those that it writes, or the beginnings of their names.
fn files(arguments: &str) -> (Vec<String>, Vec<String>) {
    let words = words(arguments);
    let words: Vec<&str> = words.iter().map(String::as_str).collect();
    let (mut read, mut written) = (Vec::new(), Vec::new());
    for (k, word) in words.iter().enumerate() {
        let is_file = READ.iter().any(|ending| word.ends_with(ending));
        if k > 0 && WRITE.contains(&words[k - 1]) || is_file && COPY.contains(&words[0]) && !read.is_empty() {
            written.push((*word).to_owned());
        } else if is_file {
            read.push((*word).to_owned());
        }
    }
    if words[0] == "export" {
        let out = words.iter().skip_while(|word| **word != "--out").nth(1);
        let of_recording = || Path::new(&read[0]).file_stem().unwrap().to_str().unwrap();
        let format = words.iter().skip_while(|word| **word != "--to").nth(1).unwrap();
        written = vec![format!("{} as {format}", out.map_or_else(of_recording, |stem| *stem))];
    }
    (read, written)
}

/// If the commands of a document are typed one after another in the project's folder, each file to read exists, and no
/// file to write does.
#[test]
fn the_commands_of_a_document_have_their_files() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut read_files = 0;
    for (path, text) in documents() {
        let mut made: Vec<String> = Vec::new();
        for line in shell_lines(&text) {
            let Some((read, written)) = arguments(line).map(files) else { continue };
            let is_of = |stem: &String, file: &str| {
                let stem = stem.split(" as ").next().unwrap();
                file.strip_prefix(stem).is_some_and(|rest| rest.is_empty() || rest.starts_with(['.', '-', '/']))
            };
            for file in &read {
                let is_there = root.join(file).exists() || made.iter().any(|stem| is_of(stem, file));
                assert!(is_there, "{}: {line}\nnothing before it makes {file}", path.display());
                read_files += 1;
            }
            for file in written {
                assert!(!made.contains(&file), "{}: {line}\n{file} is there already", path.display());
                made.push(file);
            }
        }
    }
    assert!(read_files >= 40, "only {read_files} files are read");
}

#[test]
fn every_link_within_the_project_has_its_target() {
    let mut links = 0;
    for (path, text) in documents() {
        for link in text.split("](").skip(1).filter_map(|rest| rest.split([')', '#']).next()) {
            if !link.is_empty() && !link.contains("://") {
                assert!(path.with_file_name(link).exists(), "{}: {link}", path.display());
                links += 1;
            }
        }
    }
    assert!(links >= 12, "only {links} links found");
}

#[test]
fn an_invalid_command_is_found() {
    assert!(check_arguments(["replay", "run.mcap"]).is_err());
    assert!(check_arguments(["modes", "--angle-deg", "60"]).is_err());
    assert!(check_arguments(["modes", "--angles-deg", "0,-60"]).is_ok());
}
