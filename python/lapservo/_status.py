from enum import Enum

from ._lapservo import _statuses

#: Why there is, or is not, an observation.
Status = Enum("Status", [(word, word) for word in _statuses], module="lapservo")
