# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
# In an environment with: pip install -e '.[dev]'

.PHONY: check test build ci

check:  ## lint, format and types
	ruff check .
	ruff format --check .
	mypy src tests examples benchmarks

test:
	pytest

build:  ## the wheel, in dist/
	python -m pip wheel --no-deps --wheel-dir dist .

ci:  ## all that a change must pass, in a fresh environment
	bash .ci/run
