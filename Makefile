# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
# In an environment with: pip install -e '.[dev]'

.PHONY: check test slow docs build lock ci

check:  ## lint, format, import layers and types
	ruff check .
	ruff format --check .
	lint-imports
	mypy

test:  ## the default tests: some minutes on many cores, longer on two
	pytest

slow:  ## the slow proofs
	pytest -m slow

docs:  ## the documentation site, in site/
	zensical build --strict

build:  ## the wheel, in dist/
	python -m pip wheel --no-deps --wheel-dir dist .

lock:  ## the versions of a development environment that is known to work
	uv pip compile --quiet --universal --no-emit-index-url --extra dev --output-file requirements-dev.lock pyproject.toml

ci:  ## all that a change must pass, in a fresh environment
	bash .ci/run
