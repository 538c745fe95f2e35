from identification.recursive.history import History as History
from identification.recursive.online import Online as Online
