//! Writes the generated files of the repository (`make generate`).

use std::path::Path;
use std::{fs, io};

fn main() -> io::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    for (path, content) in clouds_core::generate::files() {
        let path = root.join(path);
        // An unchanged file keeps its modification time, so that nothing is rebuilt.
        if fs::read_to_string(&path).is_ok_and(|old| old == content) {
            continue;
        }
        println!("{}", path.display());
        fs::write(path, content)?;
    }
    Ok(())
}
