# SPDX-FileCopyrightText: 2026 The fieldtruth authors
# SPDX-License-Identifier: Apache-2.0
"""Value types that the layouts of several environments share; text and booleans are not accepted as numbers."""

from typing import Annotated

from pydantic import Field

from fieldtruth.experiment.rig import Integer, Number, Positive

Size = Annotated[tuple[Positive, Positive], Field(description="[length, width], each a number above 0")]
Count = Annotated[Integer, Field(ge=0, le=400)]
Density = Annotated[Number, Field(ge=0, le=20)]
Individuals = Annotated[Integer, Field(ge=1, le=32)]
Share = Annotated[Number, Field(ge=0, le=1)]
Corners = Annotated[tuple[tuple[Number, Number], ...], Field(min_length=2, description="a list of at least two [x, y]")]
Trails = Annotated[tuple[Corners, ...], Field(description="a list of lines, each a list of at least two [x, y]")]
