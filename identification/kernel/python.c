/* The kernel for Python: one type, whose methods work on the caller's arrays. Included after rls.c, with MODULE, INITIALISE and
   RLS_SOURCE (what it was built from) defined. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>
#include <string.h>

#ifdef RLS_SINGLE
#define FORMAT "f"
#else
#define FORMAT "d"
#endif

typedef struct {
    PyObject_HEAD
    rls_config config;
    int state_size, work_size, regressors;
    void *memory; /* what config points to */
    rls_real *sample; /* regressors + outputs + inputs numbers, converted from double */
} Kernel;

/* A contiguous buffer of `count` numbers; count < 0: any. Raises TypeError, ValueError or BufferError. */
static int open_buffer(PyObject *from, Py_buffer *view, const char *format, Py_ssize_t count, int writable, const char *name)
{
    if (PyObject_GetBuffer(from, view, PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0)) < 0) return -1;
    if (!view->format || strcmp(view->format, format) != 0) {
        PyErr_Format(PyExc_TypeError, "%s: expected numbers of format %s", name, format);
    } else if (count >= 0 && view->len != count * view->itemsize) {
        PyErr_Format(PyExc_ValueError, "%s: expected %zd numbers, got %zd", name, count, view->len / view->itemsize);
    } else {
        return 0;
    }
    PyBuffer_Release(view);
    return -1;
}

static void convert(const Py_buffer *view, rls_real *to)
{
    const double *from = view->buf;
    for (Py_ssize_t i = 0; i < view->len / (Py_ssize_t)sizeof(double); i++) to[i] = (rls_real)from[i];
}

static int copy_numbers(PyObject *from, const char *format, Py_ssize_t count, void *to, const char *name)
{
    Py_buffer view;
    if (open_buffer(from, &view, format, count, 0, name) < 0) return -1;
    memcpy(to, view.buf, (size_t)view.len);
    PyBuffer_Release(&view);
    return 0;
}

static Py_ssize_t aligned(Py_ssize_t bytes) { return (bytes + 15) / 16 * 16; }

/* Kernel(outputs, inputs, memory, entries (E, 4), members (E + ny) a group, ny a group, functions, degree, knots, bernstein, slack, forgetting) */
static int kernel_init(PyObject *object, PyObject *args, PyObject *kwargs)
{
    Kernel *self = (Kernel *)object;
    rls_config *c = &self->config;
    PyObject *entries, *groups, *knots, *bernstein;
    double slack, f[6];
    int kind, pieces;
    Py_ssize_t bytes, numbers, at;
    if (kwargs && PyDict_Size(kwargs)) {
        PyErr_SetString(PyExc_TypeError, "no keywords, please");
        return -1;
    }
    if (!PyArg_ParseTuple(args, "iiiiOO!iiiOOd(idddddd)", &c->outputs, &c->inputs, &c->memory, &c->entries, &entries, &PyTuple_Type, &groups,
                          &c->basis.functions, &c->basis.degree, &pieces, &knots, &bernstein, &slack, &kind, f, f + 1, f + 2, f + 3, f + 4,
                          f + 5))
        return -1;
    c->groups = (int)PyTuple_Size(groups);
    c->basis.pieces = pieces;
    c->basis.slack = (rls_real)slack;
    c->forgetting = (rls_forgetting){kind, (rls_real)f[0], (rls_real)f[1], (rls_real)f[2], (rls_real)f[3], (rls_real)f[4], (rls_real)f[5]};
    numbers = (pieces + 1) + (Py_ssize_t)pieces * c->basis.functions * (c->basis.degree + 1);
    bytes = aligned(c->entries * (Py_ssize_t)sizeof(rls_entry)) + aligned(c->groups * (Py_ssize_t)sizeof(rls_group)) +
            aligned(numbers * (Py_ssize_t)sizeof(rls_real)) + (c->outputs + (Py_ssize_t)c->groups * c->entries) * (Py_ssize_t)sizeof(int);
    self->memory = PyMem_Calloc(1, (size_t)bytes);
    if (!self->memory) {
        PyErr_NoMemory();
        return -1;
    }
    char *next = self->memory;
    rls_entry *entry = (rls_entry *)next;
    rls_group *group = (rls_group *)(next += aligned(c->entries * (Py_ssize_t)sizeof(rls_entry)));
    rls_real *number = (rls_real *)(next += aligned(c->groups * (Py_ssize_t)sizeof(rls_group)));
    int *index = (int *)(next + aligned(numbers * (Py_ssize_t)sizeof(rls_real)));
    if (copy_numbers(entries, "i", 4 * c->entries, entry, "entries") < 0) return -1;
    if (copy_numbers(knots, FORMAT, pieces + 1, number, "knots") < 0) return -1;
    if (copy_numbers(bernstein, FORMAT, numbers - pieces - 1, number + pieces + 1, "bernstein") < 0) return -1;
    at = 0;
    for (int g = 0; g < c->groups; g++) {
        PyObject *outputs, *members;
        if (!PyArg_ParseTuple(PyTuple_GetItem(groups, g), "iOiO", &group[g].outputs, &outputs, &group[g].entries, &members)) return -1;
        if (group[g].entries > c->entries || (at += group[g].outputs) > c->outputs) {
            PyErr_SetString(PyExc_ValueError, "groups: more members than there are");
            return -1;
        }
        group[g].output = index;
        if (copy_numbers(outputs, "i", group[g].outputs, index, "outputs") < 0) return -1;
        index += group[g].outputs;
        group[g].entry = index;
        if (copy_numbers(members, "i", group[g].entries, index, "members") < 0) return -1;
        index += group[g].entries;
    }
    c->entry = entry;
    c->group = group;
    c->basis.knot = number;
    c->basis.bernstein = number + pieces + 1;
    self->state_size = rls_state_size(c);
    self->work_size = rls_work_size(c);
    self->regressors = rls_regressors(c);
    self->sample = PyMem_Calloc((size_t)(self->regressors + c->outputs + c->inputs + 1), sizeof(rls_real));
    if (!self->sample) {
        PyErr_NoMemory();
        return -1;
    }
    return 0;
}

static void kernel_dealloc(PyObject *object)
{
    Kernel *self = (Kernel *)object;
    PyTypeObject *type = Py_TYPE(object);
    PyMem_Free(self->memory);
    PyMem_Free(self->sample);
    ((freefunc)PyType_GetSlot(type, Py_tp_free))(object);
    Py_DECREF(type);
}

static int open_memory(const Kernel *self, PyObject *const *args, Py_buffer *state, Py_buffer *work)
{
    if (open_buffer(args[0], state, FORMAT, self->state_size, 1, "state") < 0) return -1;
    if (open_buffer(args[1], work, FORMAT, self->work_size, 1, "work") < 0) {
        PyBuffer_Release(state);
        return -1;
    }
    return 0;
}

static int arguments(Py_ssize_t given, Py_ssize_t expected)
{
    if (given == expected) return 0;
    PyErr_Format(PyExc_TypeError, "expected %zd arguments, got %zd", expected, given);
    return -1;
}

static PyObject *kernel_start(PyObject *object, PyObject *const *args, Py_ssize_t count)
{
    Kernel *self = (Kernel *)object;
    Py_buffer state, work;
    if (arguments(count, 2) < 0 || open_memory(self, args, &state, &work) < 0) return NULL;
    rls_init(&self->config, state.buf, work.buf);
    PyBuffer_Release(&state);
    PyBuffer_Release(&work);
    Py_RETURN_NONE;
}

static PyObject *kernel_update(PyObject *object, PyObject *const *args, Py_ssize_t count)
{
    Kernel *self = (Kernel *)object;
    const rls_config *c = &self->config;
    Py_buffer state, work, y, u;
    double p;
    int status;
    if (arguments(count, 5) < 0) return NULL;
    p = PyFloat_AsDouble(args[4]);
    if (p == -1.0 && PyErr_Occurred()) return NULL;
    if (open_buffer(args[2], &y, "d", c->outputs, 0, "y") < 0) return NULL;
    convert(&y, self->sample);
    PyBuffer_Release(&y);
    if (open_buffer(args[3], &u, "d", c->inputs, 0, "u") < 0) return NULL;
    convert(&u, self->sample + c->outputs);
    PyBuffer_Release(&u);
    if (open_memory(self, args, &state, &work) < 0) return NULL;
    status = rls_update(c, state.buf, work.buf, self->sample, self->sample + c->outputs, (rls_real)p);
    PyBuffer_Release(&state);
    PyBuffer_Release(&work);
    return PyLong_FromLong(status);
}

static PyObject *kernel_absorb(PyObject *object, PyObject *const *args, Py_ssize_t count)
{
    Kernel *self = (Kernel *)object;
    const rls_config *c = &self->config;
    Py_buffer state, work, phi, y;
    int status;
    if (arguments(count, 4) < 0) return NULL;
    if (open_buffer(args[2], &phi, "d", self->regressors, 0, "phi") < 0) return NULL;
    convert(&phi, self->sample);
    PyBuffer_Release(&phi);
    if (open_buffer(args[3], &y, "d", c->outputs, 0, "y") < 0) return NULL;
    convert(&y, self->sample + self->regressors);
    PyBuffer_Release(&y);
    if (open_memory(self, args, &state, &work) < 0) return NULL;
    status = rls_absorb(c, state.buf, work.buf, self->sample, self->sample + self->regressors);
    PyBuffer_Release(&state);
    PyBuffer_Release(&work);
    return PyLong_FromLong(status);
}

/* run(state, work, samples (n, ny + nu + 1), statuses (n), innovations (n, ny) or None, coefficients (n, nr, ny) or None) */
static PyObject *kernel_run(PyObject *object, PyObject *const *args, Py_ssize_t count)
{
    Kernel *self = (Kernel *)object;
    const rls_config *c = &self->config;
    const int ny = c->outputs, width = ny + c->inputs + 1, kept = self->regressors * ny;
    Py_buffer state, work, samples, statuses, innovations = {0}, coefficients = {0};
    Py_ssize_t n;
    PyObject *result = NULL;
    if (arguments(count, 6) < 0 || open_memory(self, args, &state, &work) < 0) return NULL;
    if (open_buffer(args[2], &samples, "d", -1, 0, "samples") < 0) goto close_memory;
    n = samples.len / (Py_ssize_t)sizeof(double) / width;
    if (open_buffer(args[3], &statuses, "i", n, 1, "statuses") < 0) goto close_samples;
    if (args[4] != Py_None && open_buffer(args[4], &innovations, FORMAT, n * ny, 1, "innovations") < 0) goto close_statuses;
    if (args[5] != Py_None && open_buffer(args[5], &coefficients, FORMAT, n * kept, 1, "coefficients") < 0) goto close_innovations;
    {
        rls_real *own = PyMem_Calloc((size_t)width, sizeof(rls_real)); /* not self->sample: other threads may run */
        if (!own) {
            PyErr_NoMemory();
            goto close_coefficients;
        }
        Py_BEGIN_ALLOW_THREADS
        for (Py_ssize_t k = 0; k < n; k++) {
            const double *from = (const double *)samples.buf + k * width;
            int status;
            for (int i = 0; i < width; i++) own[i] = (rls_real)from[i];
            status = rls_update(c, state.buf, work.buf, own, own + ny, own[width - 1]);
            ((int *)statuses.buf)[k] = status;
            if (innovations.buf && status & RLS_LEARNT)
                memcpy((rls_real *)innovations.buf + k * ny, rls_innovation(c, work.buf), (size_t)ny * sizeof(rls_real));
            if (coefficients.buf) rls_coefficients(c, state.buf, (rls_real *)coefficients.buf + k * kept);
        }
        Py_END_ALLOW_THREADS
        PyMem_Free(own);
    }
    result = Py_NewRef(Py_None);
close_coefficients:
    if (coefficients.buf) PyBuffer_Release(&coefficients);
close_innovations:
    if (innovations.buf) PyBuffer_Release(&innovations);
close_statuses:
    PyBuffer_Release(&statuses);
close_samples:
    PyBuffer_Release(&samples);
close_memory:
    PyBuffer_Release(&state);
    PyBuffer_Release(&work);
    return result;
}

static PyObject *kernel_sizes(PyObject *object, PyObject *unused)
{
    const Kernel *self = (const Kernel *)object;
    (void)unused;
    return Py_BuildValue("ii", self->state_size, self->work_size);
}

static PyMethodDef methods[] = {
    {"sizes", kernel_sizes, METH_NOARGS, "Numbers in the state, numbers of scratch."},
    {"start", (PyCFunction)(void (*)(void))kernel_start, METH_FASTCALL, "start(state, work): nothing is known."},
    {"update", (PyCFunction)(void (*)(void))kernel_update, METH_FASTCALL, "update(state, work, y, u, p) -> status bits"},
    {"absorb", (PyCFunction)(void (*)(void))kernel_absorb, METH_FASTCALL, "absorb(state, work, phi, y) -> status bits"},
    {"run", (PyCFunction)(void (*)(void))kernel_run, METH_FASTCALL, "run(state, work, samples, statuses, innovations, coefficients)"},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot slots[] = {
    {Py_tp_doc, "Recursive least squares on the caller's arrays; see rls.h."},
    {Py_tp_init, (void *)kernel_init},
    {Py_tp_dealloc, (void *)kernel_dealloc},
    {Py_tp_methods, methods},
    {0, NULL},
};

static PyType_Spec specification = {MODULE ".Kernel", sizeof(Kernel), 0, Py_TPFLAGS_DEFAULT, slots};

/* Code made for the processor it was built on must not run on a lesser one: say so instead of dying. */
static int right_processor(void)
{
    int right = 1;
#if defined(__GNUC__) && (defined(__x86_64__) || defined(__i386__))
    __builtin_cpu_init();
#ifdef __AVX512F__
    right = right && __builtin_cpu_supports("avx512f");
#endif
#ifdef __AVX2__
    right = right && __builtin_cpu_supports("avx2");
#endif
#ifdef __AVX__
    right = right && __builtin_cpu_supports("avx");
#endif
#endif
    return right;
}

static struct PyModuleDef definition = {PyModuleDef_HEAD_INIT, MODULE, "The compiled kernel.", -1, NULL, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC INITIALISE(void)
{
    PyObject *module, *type;
    if (!right_processor()) {
        PyErr_SetString(PyExc_ImportError, "it was built for another processor; install again, or set SYMHELI_NATIVE=0 when building");
        return NULL;
    }
    module = PyModule_Create(&definition);
    type = module ? PyType_FromSpec(&specification) : NULL;
    if (!type || PyModule_AddObjectRef(module, "Kernel", type) < 0 || PyModule_AddStringConstant(module, "SOURCE", RLS_SOURCE) < 0) {
        Py_XDECREF(type);
        Py_XDECREF(module);
        return NULL;
    }
    Py_DECREF(type);
    return module;
}
