# `make demo` runs the main job, `make test` the tests; both set the machine up first.
.DEFAULT_GOAL := help
.PHONY: help demo test test-long test-outside test-all setup page check clean

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

test-outside: setup ## Runs a crate that uses the library without its features
	$(CARGO) run --release -p steradian-outside

test-all: test test-long test-outside ## Runs the tests, the long sweeps and the crate outside, and checks what is not among the default features
	$(CARGO) check --release --features opentelemetry --bin steradian

setup: ## Checks toolchain, linker and Vulkan driver; installs what is missing where it can
	scripts/setup.sh

page: ## Builds the page of the daemon from web/src into web/dist
	scripts/ensure-page.sh npm
	cd web && npm run --silent build

check: ## Checks format and lints
	$(CARGO) fmt --all --check
	$(CARGO) clippy --release --workspace --all-targets -- -D warnings

clean: ## Removes what was built and rendered
	$(CARGO) clean
	rm -rf out web/node_modules web/gen
