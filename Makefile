# `make demo` renders the example scenes, `make test` runs the tests; both run `make setup` first. For a faster edit cycle see CONTRIBUTING.md.
.DEFAULT_GOAL := help
.PHONY: help demo test test-long test-outside test-all setup page check clean

CARGO ?= cargo

help: ## Lists the targets
	@sed -n 's/^\([a-z-]*\):.*## \(.*\)/\1\t\2/p' Makefile | expand -t 12

demo: setup ## Builds and renders the example scenes in all views
	$(CARGO) build --release --bin steradian --example client --example flux
	scripts/demo.sh

test: setup ## Runs the tests without the long sweeps
	$(CARGO) test --release

# Runs the tests that are ignored by default. Tests of the Yale catalogue are skipped: they are ignored only if no copy is available.
test-long: setup ## Runs the long sweeps alone
	$(CARGO) test --release --tests -- --ignored --skip yale

test-outside: setup ## Runs a crate that uses the library without its features
	$(CARGO) run --release -p steradian-outside

test-all: test test-long test-outside ## Runs all tests, including the long sweeps and the outside crate, and checks the optional features
	$(CARGO) check --release --features opentelemetry --bin steradian
	$(CARGO) check --release --no-default-features --features service --lib

setup: ## Checks toolchain, linker and Vulkan driver; installs missing packages if it can
	scripts/setup.sh

page: ## Builds the daemon's web page from web/src into web/dist
	scripts/ensure-page.sh npm
	cd web && npm run --silent build

check: ## Checks format and lints
	$(CARGO) fmt --all --check
	$(CARGO) clippy --release --workspace --all-targets -- -D warnings

clean: ## Removes builds and rendered files
	$(CARGO) clean
	rm -rf out web/node_modules web/gen
