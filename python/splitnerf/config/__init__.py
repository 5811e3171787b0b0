"""Every setting of a training run in one place: groups, presets, and their TOML form."""

from splitnerf.config.groups import MIN_EXPORT_SIZE
from splitnerf.config.presets import PRESETS, parse_setting, preset
from splitnerf.config.settings import FIELDS, GROUPS, SHORT_NAMES, Config, settings_table
