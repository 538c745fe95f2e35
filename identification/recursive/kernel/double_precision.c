#include "rls.c"

#include "python.c"
