#define RLS_SINGLE
#include "rls.c"

#include "python.c"
