# The commands of this project. `make demo` shows what it does; `make test` checks everything.

.PHONY: demo test build setup clean

demo: build
	target/release/mcpo-run experiments/smoke.toml

test: setup
	cargo fmt --check
	cargo clippy --release --all-targets -- --deny warnings
	cargo test --release

build: setup
	@test -x target/release/mcpo-run || echo "building: about 4 minutes on two cores the first time, most of it polars" >&2
	cargo build --release

setup:
	@third_party/fetch.sh

clean:
	cargo clean
