//! The checked-in code and descriptors of `proto/` match the `.proto` files.
//!
//! After an edit of a `.proto` file: `RESONARM_UPDATE_PROTO=1 cargo test --test recording schemas`.

use std::error::Error;
use std::fs;
use std::path::{Path, PathBuf};

use prost_build::Module;
use protox::prost::Message;

/// One schema a file, so that a descriptor holds only one message and its dependencies.
const NAMES: [&str; 3] = ["event", "frame_batch", "tick_batch"];

/// Path inside `proto/` and content of a generated file.
type Generated = (PathBuf, Vec<u8>);

/// All files generated from the schemas in `directory`.
fn generate(directory: &Path) -> Result<Vec<Generated>, Box<dyn Error>> {
    let mut generated = Vec::new();
    for name in NAMES {
        let descriptor = protox::Compiler::new([directory])?
            .include_source_info(false)
            .include_imports(true)
            .open_file(format!("{name}.proto"))?
            .file_descriptor_set();
        generated.push((PathBuf::from(format!("descriptors/{name}.bin")), descriptor.encode_to_vec()));
    }
    let all = protox::compile(NAMES.map(|name| format!("{name}.proto")), [directory])?;
    let module = Module::from_protobuf_package_name("resonarm.v1");
    let requests = all.file.into_iter().map(|file| (module.clone(), file)).collect();
    for (_, code) in prost_build::Config::new().generate(requests)? {
        generated.push((PathBuf::from("resonarm.v1.rs"), code.into_bytes()));
    }
    Ok(generated)
}

#[test]
fn checked_in_code_is_what_the_schemas_say() -> Result<(), Box<dyn Error>> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("proto");
    let generated = generate(&directory)?;
    assert_eq!(generated.len(), NAMES.len() + 1);
    for (path, content) in generated {
        let path = directory.join(path);
        if std::env::var_os("RESONARM_UPDATE_PROTO").is_some_and(|value| value == "1") {
            fs::write(&path, &content)?;
        }
        assert!(
            fs::read(&path).is_ok_and(|found| found == content),
            "{} is not what proto/*.proto say: run `RESONARM_UPDATE_PROTO=1 cargo test --test recording schemas`",
            path.display()
        );
    }
    Ok(())
}

#[test]
fn every_schema_is_listed() -> Result<(), Box<dyn Error>> {
    let directory = Path::new(env!("CARGO_MANIFEST_DIR")).join("proto");
    let mut found: Vec<String> = fs::read_dir(directory)?
        .filter_map(|entry| entry.ok()?.file_name().to_str()?.strip_suffix(".proto").map(String::from))
        .collect();
    found.sort();
    assert_eq!(found, NAMES);
    Ok(())
}
