# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Runs on several machines or processes, by Dask (pip install 'fieldtruth[cluster]').

World, drive and slices are made by the workers of a Dask scheduler; this process joins the slices. The bytes are those
of a run in one process. Dask is imported only here, and only when a cluster is asked for.
"""

from fieldtruth.cluster.connection import cluster_engine

__all__ = ["cluster_engine"]
