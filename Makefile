# The commands of this project. `make demo` shows what it does; `make test` checks everything.

PROGRAM := $(or $(CARGO_TARGET_DIR),target)/release/mcpo-run

.PHONY: demo test soak build ci-results setup clean

demo: build
	$(PROGRAM) experiments/smoke.toml

test: setup
	@tests/slurm/cluster.sh install || echo "make: what needs Slurm will be skipped" >&2
	cargo fmt --check
	cargo clippy --release --all-targets -- --deny warnings
	cargo test --release

# Kills and faults without number, for SOAK_SECONDS (an hour): no run may be lost, and no bit change.
soak: build
	PROGRAM=$(abspath $(PROGRAM)) tests/soak/disturb.sh $(or $(SOAK_SECONDS),3600)

# What `make test` compares this program's numbers with; to be recorded again whenever they are meant to change.
ci-results: build
	rm -rf results/ci
	$(PROGRAM) verify experiments/ci.toml --against results/ci --record

build: setup
	@test -x $(PROGRAM) || echo "building: about 3 minutes on two cores the first time, most of it polars" >&2
	cargo build --release

setup:
	@third_party/fetch.sh

clean:
	cargo clean
