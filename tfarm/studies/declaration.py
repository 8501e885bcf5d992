"""Former place of `tfarm.ensemble.declaration`, from which the command of studies imports."""

from tfarm.ensemble.declaration import load_study as load_study
