from manytouch.analysis.plots import (
    plot_contacts as plot_contacts,
    plot_layout as plot_layout,
    plot_surface as plot_surface,
)
from manytouch.analysis.read_results import Results as Results, read_results as read_results
from manytouch.calibration import sensor_from_rest as sensor_from_rest
from manytouch.errors import (
    ArgumentError as ArgumentError,
    ContactError as ContactError,
    LayoutError as LayoutError,
    ManytouchError as ManytouchError,
    MissingExtraError as MissingExtraError,
    OutputError as OutputError,
    SensorError as SensorError,
    SourceError as SourceError,
)
from manytouch.geometry.surface_sampling import sample as sample
from manytouch.pipeline import (
    Detector as Detector,
    Estimator as Estimator,
    Pipeline as Pipeline,
    Sink as Sink,
    Tracker as Tracker,
)
from manytouch.session import (
    METHODS as METHODS,
    Observer as Observer,
    pipeline_for as pipeline_for,
    prepare as prepare,
    process as process,
    run as run,
)
from manytouch.session.stream import Stream as Stream, stream as stream
from manytouch.simulation.contacts import (
    Ball as Ball,
    Patch as Patch,
    PointForces as PointForces,
    simulate_contacts as simulate_contacts,
)
from manytouch.sources import Capabilities as Capabilities, Source as Source, open_source as open_source
from manytouch.values import (
    Camera as Camera,
    Contact as Contact,
    Contacts as Contacts,
    ContactShape as ContactShape,
    Detections as Detections,
    Frame as Frame,
    Layout as Layout,
    OutlineRing as OutlineRing,
    Phase as Phase,
    Reading as Reading,
    Roi as Roi,
    Sensor as Sensor,
    Sheet as Sheet,
    SheetSpline as SheetSpline,
    Status as Status,
    Surface as Surface,
    TrackedGrid as TrackedGrid,
    Truth as Truth,
)
from manytouch.values.sensor_file.read import (
    known_sensors as known_sensors,
    load_sensor as load_sensor,
)
from manytouch.values.sensor_file.write import save_sensor as save_sensor

__version__: str
