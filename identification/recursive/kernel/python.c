/* The kernel for Python: one type, whose methods work on the caller's arrays. Included after rls.c,
   with RLS_MODULE (the module's name, one for each precision and level of processor) and RLS_SOURCE
   (what it was built from) defined. */
#define PY_SSIZE_T_CLEAN
#define Py_LIMITED_API 0x030b0000
#include <Python.h>
#include <string.h>

#define QUOTED(name) #name
#define TEXT(macro) QUOTED(macro)
#define JOINED(a, b) a##b
#define INITIALISE(module) JOINED(PyInit_, module)
#define MODULE "identification.recursive.kernel." TEXT(RLS_MODULE)

#ifdef RLS_SINGLE
#define FORMAT "f"
#else
#define FORMAT "d"
#endif

typedef struct {
    PyObject_HEAD
    rls_config config;
    int state_size, work_size, regressors, width; /* width: numbers in a sample */
    void *memory; /* what config points to */
    rls_real *sample; /* regressors + width numbers, converted from double */
    /* state and work of the last call: an estimator comes with the same ones again and again */
    Py_buffer held[2];
} Kernel;

static PyObject *dtype_name, *float64; /* "dtype" and numpy.dtype("float64") */

/* A contiguous buffer of `count` numbers; count < 0: any. Raises TypeError, ValueError or
   BufferError. */
static int open_buffer(PyObject *from, Py_buffer *view, const char *format, Py_ssize_t count,
                       int writable, const char *name)
{
    if (PyObject_GetBuffer(from, view,
                           PyBUF_C_CONTIGUOUS | PyBUF_FORMAT | (writable ? PyBUF_WRITABLE : 0)) < 0)
        return -1;
    if (!view->format || strcmp(view->format, format) != 0) {
        PyErr_Format(PyExc_TypeError, "%s: expected numbers of format %s", name, format);
    } else if (count >= 0 && view->len != count * view->itemsize) {
        PyErr_Format(PyExc_ValueError, "%s: expected %zd numbers, got %zd", name, count,
                     view->len / view->itemsize);
    } else {
        return 0;
    }
    PyBuffer_Release(view);
    return -1;
}

/* The same of `count` doubles, without asking an array for its format where its dtype says it: that
   takes longer than all the rest. */
static int open_doubles(PyObject *from, Py_buffer *view, Py_ssize_t count, const char *name)
{
    PyObject *dtype = PyObject_GetAttr(from, dtype_name);
    const int known = dtype == float64;
    if (!dtype) PyErr_Clear();
    Py_XDECREF(dtype);
    if (!known) return open_buffer(from, view, "d", count, 0, name);
    if (PyObject_GetBuffer(from, view, PyBUF_C_CONTIGUOUS) < 0) return -1;
    if (view->len == count * (Py_ssize_t)sizeof(double)) return 0;
    PyErr_Format(PyExc_ValueError, "%s: expected %zd numbers, got %zd", name, count,
                 view->len / (Py_ssize_t)sizeof(double));
    PyBuffer_Release(view);
    return -1;
}

/* `count` doubles into `to`. */
static int convert(PyObject *from, Py_ssize_t count, rls_real *to, const char *name)
{
    Py_buffer view;
    const double *number;
    if (open_doubles(from, &view, count, name) < 0) return -1;
    number = view.buf;
    for (Py_ssize_t i = 0; i < count; i++) to[i] = (rls_real)number[i];
    PyBuffer_Release(&view);
    return 0;
}

/* The numbers of a writable array, which is held until another comes. */
static rls_real *hold(Py_buffer *held, PyObject *from, Py_ssize_t count, const char *name)
{
    Py_buffer view;
    if (held->obj != from) {
        if (open_buffer(from, &view, FORMAT, count, 1, name) < 0) return NULL;
        if (held->obj) PyBuffer_Release(held);
        *held = view;
    }
    return held->buf;
}

static int copy_numbers(PyObject *from, const char *format, Py_ssize_t count, void *to,
                        const char *name)
{
    Py_buffer view;
    if (open_buffer(from, &view, format, count, 0, name) < 0) return -1;
    memcpy(to, view.buf, (size_t)view.len);
    PyBuffer_Release(&view);
    return 0;
}

/* The next `bytes` of the memory behind *next, aligned for anything. */
static void *take(char **next, size_t bytes)
{
    void *here = *next;
    *next += (bytes + 15) / 16 * 16;
    return here;
}

/* Bytes of memory for a configuration of `factors` with so many numbers in all: an upper bound of
   what kernel_init takes. */
static size_t memory_needed(const rls_config *c, Py_ssize_t numbers)
{
    const size_t groups = (size_t)c->groups, factors = (size_t)c->basis.factors,
                 entries = (size_t)c->entries;
    return entries * sizeof(rls_entry) + groups * sizeof(rls_group) + factors * sizeof(rls_factor) +
           (size_t)numbers * sizeof(rls_real) +
           ((size_t)c->basis.functions * factors + groups * ((size_t)c->outputs + entries)) *
               sizeof(int) +
           16 * (5 + 2 * factors + 2 * groups);
}

static int read_groups(rls_config *c, rls_group *group, PyObject *groups, char **next)
{
    for (int g = 0; g < c->groups; g++) {
        PyObject *outputs, *members;
        int *index;
        if (!PyArg_ParseTuple(PyTuple_GetItem(groups, g), "iOiO", &group[g].outputs, &outputs,
                              &group[g].entries, &members))
            return -1;
        if (group[g].entries > c->entries || group[g].outputs > c->outputs) {
            PyErr_SetString(PyExc_ValueError, "groups: more members than there are");
            return -1;
        }
        group[g].output = index = take(next, (size_t)group[g].outputs * sizeof(int));
        if (copy_numbers(outputs, "i", group[g].outputs, index, "outputs") < 0) return -1;
        group[g].entry = index = take(next, (size_t)group[g].entries * sizeof(int));
        if (copy_numbers(members, "i", group[g].entries, index, "members") < 0) return -1;
    }
    return 0;
}

static int read_factors(rls_config *c, rls_factor *factor, PyObject *factors, char **next)
{
    for (int i = 0; i < c->basis.factors; i++) {
        PyObject *knots, *bernstein;
        double slack;
        Py_ssize_t count;
        rls_real *number;
        if (!PyArg_ParseTuple(PyTuple_GetItem(factors, i), "iiidOO", &factor[i].functions,
                              &factor[i].degree, &factor[i].pieces, &slack, &knots, &bernstein))
            return -1;
        factor[i].slack = (rls_real)slack;
        count = factor[i].pieces + 1;
        factor[i].knot = number = take(next, (size_t)count * sizeof(rls_real));
        if (copy_numbers(knots, FORMAT, count, number, "knots") < 0) return -1;
        count = (Py_ssize_t)factor[i].pieces * factor[i].functions * (factor[i].degree + 1);
        factor[i].bernstein = number = take(next, (size_t)count * sizeof(rls_real));
        if (copy_numbers(bernstein, FORMAT, count, number, "bernstein") < 0) return -1;
    }
    return 0;
}

/* Kernel(outputs, inputs, parameters, memory, entries (E, 4), groups, functions, factors, numbers
   in them and in largest, index (functions, factors), largest (functions), forgetting); a group
   (outputs, their indices, entries, their indices), a factor (functions, degree, pieces, slack,
   knots, bernstein) */
static int kernel_init(PyObject *object, PyObject *args, PyObject *kwargs)
{
    Kernel *self = (Kernel *)object;
    rls_config *c = &self->config;
    PyObject *entries, *groups, *factors, *index;
    double f[6];
    int kind, entry_count;
    Py_ssize_t numbers;
    char *next;
    rls_entry *entry;
    rls_group *group;
    rls_factor *factor;
    int *product;
    rls_real *largest;
    PyObject *sizes;
    if ((kwargs && PyDict_Size(kwargs)) || self->memory) {
        PyErr_SetString(PyExc_TypeError, "a Kernel is made once, without keywords");
        return -1;
    }
    if (!PyArg_ParseTuple(args, "iiiiiOO!iO!nOO(idddddd)", &c->outputs, &c->inputs, &c->parameters,
                          &c->memory, &entry_count, &entries, &PyTuple_Type, &groups,
                          &c->basis.functions, &PyTuple_Type, &factors, &numbers, &index, &sizes,
                          &kind, f, f + 1, f + 2, f + 3, f + 4, f + 5))
        return -1;
    c->entries = entry_count;
    c->groups = (int)PyTuple_Size(groups);
    c->basis.factors = (int)PyTuple_Size(factors);
    c->forgetting = (rls_forgetting){kind,           (rls_real)f[0], (rls_real)f[1], (rls_real)f[2],
                                     (rls_real)f[3], (rls_real)f[4], (rls_real)f[5]};
    next = self->memory = PyMem_Calloc(1, memory_needed(c, numbers));
    if (!self->memory) {
        PyErr_NoMemory();
        return -1;
    }
    c->entry = entry = take(&next, (size_t)c->entries * sizeof(rls_entry));
    c->group = group = take(&next, (size_t)c->groups * sizeof(rls_group));
    c->basis.factor = factor = take(&next, (size_t)c->basis.factors * sizeof(rls_factor));
    c->basis.index = product =
        take(&next, (size_t)(c->basis.functions * c->basis.factors) * sizeof(int));
    c->basis.largest = largest = take(&next, (size_t)c->basis.functions * sizeof(rls_real));
    if (copy_numbers(sizes, FORMAT, c->basis.functions, largest, "largest") < 0) return -1;
    if (copy_numbers(entries, "i", 4 * c->entries, entry, "entries") < 0) return -1;
    if (copy_numbers(index, "i", c->basis.functions * c->basis.factors, product, "index") < 0)
        return -1;
    if (read_groups(c, group, groups, &next) < 0 || read_factors(c, factor, factors, &next) < 0)
        return -1;
    self->state_size = rls_state_size(c);
    self->work_size = rls_work_size(c);
    self->regressors = rls_regressors(c);
    self->width =
        c->outputs + c->inputs + c->parameters + (c->basis.factors ? 0 : c->basis.functions);
    self->sample = PyMem_Calloc((size_t)(self->regressors + self->width), sizeof(rls_real));
    if (!self->sample) {
        PyErr_NoMemory();
        return -1;
    }
    return 0;
}

/* A row [y, u, p], or [y, u, p, f] where the functions are the caller's. */
static int update_row(const rls_config *c, rls_real *state, rls_real *work, const rls_real *row)
{
    const rls_real *u = row + c->outputs, *p = u + c->inputs;
    return rls_update_with(c, state, work, row, u, p, c->basis.factors ? 0 : p + c->parameters);
}

static void kernel_dealloc(PyObject *object)
{
    Kernel *self = (Kernel *)object;
    PyTypeObject *type = Py_TYPE(object);
    for (int i = 0; i < 2; i++)
        if (self->held[i].obj) PyBuffer_Release(&self->held[i]);
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

/* update(state, work, y, u, p) or, where the functions are the caller's, update(state, work, y, u,
   p, f); a single p may be a number. */
static PyObject *kernel_update(PyObject *object, PyObject *const *args, Py_ssize_t count)
{
    Kernel *self = (Kernel *)object;
    const rls_config *c = &self->config;
    const int given = c->basis.factors == 0,
              sizes[] = {c->outputs, c->inputs, c->parameters, c->basis.functions};
    static const char *const names[] = {"y", "u", "p", "f"};
    rls_real *to = self->sample, *state, *work;
    if (arguments(count, 5 + given) < 0) return NULL;
    for (int i = 0; i < 3 + given; i++) {
        if (i == 2 && c->parameters == 1 && PyFloat_Check(args[4]))
            *to = (rls_real)PyFloat_AsDouble(args[4]);
        else if (convert(args[2 + i], sizes[i], to, names[i]) < 0)
            return NULL;
        to += sizes[i];
    }
    if (!(state = hold(&self->held[0], args[0], self->state_size, "state"))) return NULL;
    if (!(work = hold(&self->held[1], args[1], self->work_size, "work"))) return NULL;
    return PyLong_FromLong(update_row(c, state, work, self->sample));
}

static PyObject *kernel_absorb(PyObject *object, PyObject *const *args, Py_ssize_t count)
{
    Kernel *self = (Kernel *)object;
    const rls_config *c = &self->config;
    rls_real *phi = self->sample, *y = phi + self->regressors, *state, *work;
    if (arguments(count, 4) < 0) return NULL;
    if (convert(args[2], self->regressors, phi, "phi") < 0 ||
        convert(args[3], c->outputs, y, "y") < 0)
        return NULL;
    if (!(state = hold(&self->held[0], args[0], self->state_size, "state"))) return NULL;
    if (!(work = hold(&self->held[1], args[1], self->work_size, "work"))) return NULL;
    return PyLong_FromLong(rls_absorb(c, state, work, phi, y));
}

/* run(state, work, samples (n, width), statuses (n), innovations (n, ny) or None, coefficients (n,
   nr, ny) or None) */
static PyObject *kernel_run(PyObject *object, PyObject *const *args, Py_ssize_t count)
{
    Kernel *self = (Kernel *)object;
    const rls_config *c = &self->config;
    const int ny = c->outputs, width = self->width, kept = self->regressors * ny;
    Py_buffer state, work, samples, statuses, innovations = {0}, coefficients = {0};
    Py_ssize_t n;
    PyObject *result = NULL;
    if (arguments(count, 6) < 0 || open_memory(self, args, &state, &work) < 0) return NULL;
    if (open_buffer(args[2], &samples, "d", -1, 0, "samples") < 0) goto close_memory;
    n = samples.len / (Py_ssize_t)sizeof(double) / width;
    if (open_buffer(args[3], &statuses, "i", n, 1, "statuses") < 0) goto close_samples;
    if (args[4] != Py_None &&
        open_buffer(args[4], &innovations, FORMAT, n * ny, 1, "innovations") < 0)
        goto close_statuses;
    if (args[5] != Py_None &&
        open_buffer(args[5], &coefficients, FORMAT, n * kept, 1, "coefficients") < 0)
        goto close_innovations;
    {
        /* not self->sample: other threads may run */
        rls_real *own = PyMem_Calloc((size_t)width, sizeof(rls_real));
        if (!own) {
            PyErr_NoMemory();
            goto close_coefficients;
        }
        Py_BEGIN_ALLOW_THREADS
        for (Py_ssize_t k = 0; k < n; k++) {
            const double *from = (const double *)samples.buf + k * width;
            int status;
            for (int i = 0; i < width; i++) own[i] = (rls_real)from[i];
            status = update_row(c, state.buf, work.buf, own);
            ((int *)statuses.buf)[k] = status;
            if (innovations.buf && status & RLS_LEARNT)
                memcpy((rls_real *)innovations.buf + k * ny, rls_innovation(c, work.buf),
                       (size_t)ny * sizeof(rls_real));
            if (coefficients.buf)
                rls_coefficients(c, state.buf, (rls_real *)coefficients.buf + k * kept);
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
    {"start", (PyCFunction)(void (*)(void))kernel_start, METH_FASTCALL,
     "start(state, work): nothing is known."},
    {"update", (PyCFunction)(void (*)(void))kernel_update, METH_FASTCALL,
     "update(state, work, y, u, p) -> status bits"},
    {"absorb", (PyCFunction)(void (*)(void))kernel_absorb, METH_FASTCALL,
     "absorb(state, work, phi, y) -> status bits"},
    {"run", (PyCFunction)(void (*)(void))kernel_run, METH_FASTCALL,
     "run(state, work, samples, statuses, innovations, coefficients)"},
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

static struct PyModuleDef definition = {
    PyModuleDef_HEAD_INIT, MODULE, "The compiled kernel.", -1, NULL, NULL, NULL, NULL, NULL};

PyMODINIT_FUNC INITIALISE(RLS_MODULE)(void)
{
    PyObject *module, *type;
    if (!dtype_name && !(dtype_name = PyUnicode_InternFromString("dtype"))) return NULL;
    if (!float64) {
        PyObject *numpy = PyImport_ImportModule("numpy");
        float64 = numpy ? PyObject_CallMethod(numpy, "dtype", "s", "float64") : NULL;
        Py_XDECREF(numpy);
        if (!float64) return NULL;
    }
    module = PyModule_Create(&definition);
    type = module ? PyType_FromSpec(&specification) : NULL;
    if (!type || PyModule_AddObjectRef(module, "Kernel", type) < 0 ||
        PyModule_AddStringConstant(module, "SOURCE", RLS_SOURCE) < 0) {
        Py_XDECREF(type);
        Py_XDECREF(module);
        return NULL;
    }
    Py_DECREF(type);
    return module;
}
