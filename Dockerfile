# The server as a container. The rules are compiled while it is built, so that it starts at once.
FROM python:3.11-slim
WORKDIR /app
ENV PYTHONUNBUFFERED=1 PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
RUN useradd --create-home kitchenmind && mkdir /app/var && chown kitchenmind /app/var

# The dependencies alone first: they change seldom. Serving needs no torch; the dashboard's reports need the analysis.
COPY pyproject.toml ./
RUN python -c "import tomllib as t; p = t.load(open('pyproject.toml', 'rb'))['project']; \
    print(*p['dependencies'], *p['optional-dependencies']['analysis'], sep='\n')" > dependencies.txt \
    && pip install --requirement dependencies.txt

COPY --chown=kitchenmind . .
RUN pip install --no-deps --editable .
USER kitchenmind
RUN python -c "import numpy as np; from overcooked.layout import load_layout as l; from overcooked.state import Kitchens as K; \
    k = K.start(l('coordination_ring')); k.step(np.zeros((1, 2), np.int8), np.zeros((1, 2), np.int32)); k.encode(); \
    from models.inference.worker import Worker as W; from models.inference.wire import Load as L; \
    W(L((), (('coordination_ring', 'sp_predictor_stream'), ('coordination_ring', 'sp_predictor_window'))))"

VOLUME /app/var
EXPOSE 8000
HEALTHCHECK --interval=10s --timeout=5s --start-period=60s \
    CMD python -c "import urllib.request as u; u.urlopen('http://127.0.0.1:8000/health/ready', timeout=4)"
CMD ["kitchenmind", "serve", "--host", "0.0.0.0"]
