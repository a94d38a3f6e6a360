# `make demo` runs the main job, `make test` the tests; both set the machine up first.
.DEFAULT_GOAL := help
.PHONY: help demo test test-long test-all setup check clean

CARGO ?= cargo

help: ## Lists the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1\t\2/p' Makefile | expand -t 12

demo: setup ## Builds and renders the example scenes in all views
	$(CARGO) build --release --bin steradian --example client --example flux
	scripts/demo.sh

test: setup ## Runs the tests, all but the long sweeps
	$(CARGO) test --release

# Those that are ignored by default. The ones that need a copy of the Yale catalogue are among them only where there is none.
test-long: setup ## Runs the long sweeps alone
	$(CARGO) test --release --tests -- --ignored --skip yale

test-all: test test-long ## Runs the tests and the long sweeps

setup: ## Checks toolchain, linker and Vulkan driver; installs what is missing where it can
	scripts/setup.sh

check: ## Checks format and lints
	$(CARGO) fmt --check
	$(CARGO) clippy --release --all-targets -- -D warnings

clean: ## Removes what was built and rendered
	$(CARGO) clean
	rm -rf out
