"""What every table of a scenario has in common, and the kinds of numbers that tables are made of."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Fraction = Annotated[float, Field(ge=0, le=1)]
Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Heading = Annotated[float, Field(ge=-360, le=360)]
Likert = Annotated[float, Field(ge=1, le=5)]


class Section(BaseModel):
    """One table of the file: no unknown key, no change after loading, no NaN or infinity."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, validate_default=True)
