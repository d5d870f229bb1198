"""The names of the package, and where each is defined."""

from .arguments import (
    ExportArguments as ExportArguments,
    FollowArguments as FollowArguments,
    OptimiseArguments as OptimiseArguments,
    PlanArguments as PlanArguments,
    PlayArguments as PlayArguments,
    SimulateArguments as SimulateArguments,
    with_arguments as with_arguments,
)
from .error_handling import (
    FAILED as FAILED,
    INTERRUPTED as INTERRUPTED,
    MISTAKE as MISTAKE,
    CommandGroup as CommandGroup,
)
from .files import (
    PICTURE_SUFFIXES as PICTURE_SUFFIXES,
    OutputError as OutputError,
    check_folder as check_folder,
    check_new_folder as check_new_folder,
    check_output as check_output,
    fail as fail,
    load_marionette as load_marionette,
    output_errors as output_errors,
    puppet_path as puppet_path,
)
from .identify_arguments import IdentifyArguments as IdentifyArguments
from .motions import (
    FileMotion as FileMotion,
    film_options as film_options,
    load_motion as load_motion,
    report_lateness as report_lateness,
    report_score as report_score,
    score_lines as score_lines,
)
from .options import (
    Bodies as Bodies,
    Fps as Fps,
    PuppetFile as PuppetFile,
    Quiet as Quiet,
    SchemaKind as SchemaKind,
    StringModel as StringModel,
    require_positive as require_positive,
    resolve_bundled as resolve_bundled,
)
from .output_options import OutputOptions as OutputOptions, check_time_range as check_time_range
from .outputs import (
    check_bodies as check_bodies,
    check_captions as check_captions,
    check_extras as check_extras,
    check_outputs as check_outputs,
    write_outputs as write_outputs,
)
from .page_arguments import (
    PageOptions as PageOptions,
    PerformArguments as PerformArguments,
    ShowArguments as ShowArguments,
)
from .plausibility import (
    inputs_warnings as inputs_warnings,
    puppet_warnings as puppet_warnings,
    warn_implausible as warn_implausible,
)
from .recording import (
    load_recording as load_recording,
    recorded_start as recorded_start,
    with_recorded_winches as with_recorded_winches,
)
from .reporting import report_run as report_run
from .start import read_values as read_values, start_state as start_state
from .terminal import (
    ProgressDisplay as ProgressDisplay,
    format_number as format_number,
    print_message as print_message,
    print_output as print_output,
    print_table as print_table,
    terminal_width as terminal_width,
    version_text as version_text,
)
