"""Names of this package and where they live; `lazy_loader` loads each when it is first used."""

from .catalogue import OBJECT_SETS as OBJECT_SETS
from .catalogue import load_object as load_object
from .from_mesh import read_body as read_body
from .model import ObjectModel as ObjectModel
from .model import Part as Part
