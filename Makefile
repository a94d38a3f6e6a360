# `make demo` runs the main job, `make test` all tests; both set the machine up first.
.DEFAULT_GOAL := help
.PHONY: help demo test setup check clean

CARGO ?= cargo

help: ## Lists the targets
	@sed -n 's/^\([a-z]*\):.*## \(.*\)/\1\t\2/p' Makefile | expand -t 8

demo: setup ## Builds and renders the example scenes in all views
	$(CARGO) build --release --bin steradian --example client --example flux
	scripts/demo.sh

test: setup ## Runs all tests
	$(CARGO) test --release

setup: ## Checks toolchain, linker and Vulkan driver; installs what is missing where it can
	scripts/setup.sh

check: ## Checks format and lints
	$(CARGO) fmt --check
	$(CARGO) clippy --release --all-targets -- -D warnings

clean: ## Removes what was built and rendered
	$(CARGO) clean
	rm -rf out
