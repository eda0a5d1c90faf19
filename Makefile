# The commands of this project. `make demo` shows what it does; `make test` checks everything.

.PHONY: demo test build ci-results setup clean

demo: build
	target/release/mcpo-run experiments/smoke.toml

test: setup
	cargo fmt --check
	cargo clippy --release --all-targets -- --deny warnings
	cargo test --release

# What `make test` compares this program's numbers with; to be made anew whenever they are meant to change.
ci-results: build
	rm -rf results/ci
	target/release/mcpo-run verify experiments/ci.toml --against results/ci --record

build: setup
	@test -x target/release/mcpo-run || echo "building: about 3 minutes on two cores the first time, most of it polars" >&2
	cargo build --release

setup:
	@third_party/fetch.sh

clean:
	cargo clean
